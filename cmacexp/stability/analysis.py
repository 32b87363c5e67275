"""The stability analysis of one run: its growth, that of other leads, and the reasons."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.config import Config
from cmacexp.data.stored_run import StoredRun, read_config
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.stability.cycle_map import NotPredictable, open_loop
from cmacexp.stability.growth import Growth, change_sizes, predicted_growth, with_lead
from cmacexp.stability.measured import Stretch, growth_over, read_changes, stretch
from cmacexp.stability.mode import Mode, describe
from cmacexp.stability.transfer import Spectrum, compute_spectrum, locals_along
from cmacexp.typing import Array

LEADS = (-2, -1, 0, 1, 2, 3)
MAX_CYCLES_OF_OTHER_LEADS = 200
"""Cycles that other leads are run for, in memory."""
LOWEST_FREQUENCY = 1.0
"""Lowest frequency of T, Hz; the highest is half the sampling rate."""
FREQUENCIES = 200
"""Number of frequencies at which T is computed."""
STEPS_AFTER_LIFT_OFF = 5
"""Samples after lift-off where T is computed: the foot has left the ground."""


@dataclass(frozen=True)
class LeadGrowth:
    """Growth with one lead; NaN where it is not defined."""

    lead: int
    place: Stretch
    sizes: Array
    """(n,): changes of the feedback from cycle to cycle, N m."""
    completed: bool
    growth: Growth | None
    """None if the loop could not be linearised."""
    why_not: str = ""

    @property
    def measured(self) -> float:
        """Growth per cycle in the run."""
        return growth_over(self.sizes, self.place)

    @property
    def predicted(self) -> float:
        """Growth per cycle of the linearised loop over the same cycles."""
        return self.growth.over(self.place.first, self.place.last) if self.growth else float("nan")

    @property
    def eigenvalue(self) -> float:
        """The largest absolute value."""
        return float(abs(self.growth.krylov.eigenvalues()[0])) if self.growth else float("nan")


@dataclass(frozen=True)
class Analysis:
    """The stability of one run."""

    run: StoredRun
    config: Config
    own: LeadGrowth
    """Measured in the run's trace, unless the guard of learning acted."""
    leads: Sequence[LeadGrowth]
    """Measured in memory, but that of the run."""
    predicted_mode: Mode
    """Predicted change of the feedforward in the last cycle of the stretch."""
    measured_mode: Mode
    """The measured one."""
    places: dict[str, Spectrum]
    """T at a few places of the first leg's cycle."""
    guarded: int
    """Cycle in which the guard of learning acted, 0: in none; the run is then measured in memory, without it."""

    @property
    def tried(self) -> list[int]:
        """The leads, samples."""
        return [each.lead for each in self.leads]

    def least_real(self, lead: int) -> float:
        """Least Re T over all frequencies and those places."""
        return min(spectrum.least(lead) for spectrum in self.places.values())


def _measure_lead(lead: int, config: Config, sizes: Sequence[float] | Array, completed: bool) -> LeadGrowth:
    if len(sizes) <= config.learning.start_cycle:
        place = Stretch(1, 1, 1)
        return LeadGrowth(lead, place, np.asarray(sizes), completed, None, f"ends in cycle {len(sizes) + 2}")
    place = stretch(sizes, config.learning.start_cycle, completed)
    try:
        return LeadGrowth(lead, place, np.asarray(sizes), completed, predicted_growth(config, place.calm))
    except NotPredictable as error:
        return LeadGrowth(lead, place, np.asarray(sizes), completed, None, str(error))


def _run_lead(lead: int, config: Config, cycles: int) -> LeadGrowth:
    other = with_lead(config, lead)
    sizes = change_sizes(other, cycles)
    return _measure_lead(lead, other, sizes, len(sizes) == cycles - 1)


def _read_feedforward_change(run: StoredRun, cycle: int, shape: tuple[int, int, int]) -> Array:
    """Change of the feedforward from ``cycle`` to the next, (N, L, J), N m."""
    rows = run.cycles([cycle, cycle + 1]).sort_values(["step", "leg"])
    names = [f"tau_feedforward_{joint + 1}" for joint in range(shape[2])]
    torques = [rows.loc[rows["cycle"] == c, names] for c in (cycle, cycle + 1)]
    return np.asarray(torques[1].to_numpy() - torques[0].to_numpy()).reshape(shape)


def _run_feedforward_change(config: Config, cycle: int) -> Array:
    """The same of a run in memory, without the guard of learning."""
    loop = open_loop(config)
    before = after = np.zeros(0)
    while loop.cycles <= cycle and loop.advance(loop.period):
        before, after = after, loop.column("tau_feedforward")
    return np.asarray(after - before)


def choose_samples(support: Any) -> dict[str, int]:
    """Samples by the name of their place: after the first leg's lift-off, in mid transfer and in mid support."""
    first_leg, n = support[:, 0], len(support)
    if first_leg.all():
        return {"standing": n // 2}
    lift = int(np.flatnonzero(~first_leg & np.roll(first_leg, 1))[0])
    transfer = int((~first_leg).sum())
    middle = lift + transfer + (n - transfer) // 2
    return {
        f"{STEPS_AFTER_LIFT_OFF} samples after lift-off": (lift + STEPS_AFTER_LIFT_OFF) % n,
        "mid transfer": (lift + transfer // 2) % n,
        "mid support": middle % n,
    }


def read_learning(run: StoredRun) -> Config:
    """The config of a run; of a lead that it estimated, with the last estimate.

    Raises:
        BadRun: it cannot be read.
    """
    config = read_config(run)
    return with_lead(config, int(run.manifest["learning_lead"])) if config.learning.lead == "estimate" else config


def analyse(run: StoredRun) -> Analysis:
    """Linearise the loop of a stored run, and compare its prediction with the measurement.

    Args:
        run: that ended, with any status.

    Raises:
        BadRun: the run cannot be read.
        NotPredictable: it is too short, thinned, does not learn, or its loop cannot be linearised.
    """
    config = read_learning(run)
    guarded = next((event["cycle"] for event in run.manifest.get("guard", [])), 0)
    enough = min(config.cycles, MAX_CYCLES_OF_OTHER_LEADS)
    sizes: Sequence[float] | Array = change_sizes(config, enough) if guarded else read_changes(run, config.joints)
    if len(sizes) < config.learning.start_cycle + 3:
        raise NotPredictable(f"growth is measured over at least {config.learning.start_cycle + 4} cycles; run more")
    scenario = make_scenario(config)
    lead = scenario.setup.lead
    own = _measure_lead(lead, config, sizes, len(sizes) == enough - 1 if guarded else run.status == "completed")
    if own.growth is None:
        raise NotPredictable(own.why_not)
    leads = sorted({*LEADS, lead}) if isinstance(scenario.plant, AnalyticPlant) else [lead]  # others take minutes
    others = [own if tried == lead else _run_lead(tried, config, enough) for tried in leads]
    return _explain(run, scenario, own, others, guarded)


def _explain(
    run: StoredRun, scenario: Scenario, own: LeadGrowth, others: Sequence[LeadGrowth], guarded: int
) -> Analysis:
    assert own.growth is not None
    config, support = scenario.setup.config, scenario.setup.plan.support
    predicted = own.growth.changes(own.place.last - own.place.calm)[-1, 1]
    if guarded:
        measured = _run_feedforward_change(config, own.place.last)
    else:
        measured = _read_feedforward_change(run, own.place.last, own.growth.shape)
    period = config.sampling_period
    places = choose_samples(support)
    by_sample = {local.sample: local for local in locals_along(config, own.place.calm, list(places.values()))}
    frequencies = np.linspace(min(LOWEST_FREQUENCY, 0.05 / period), 0.5 / period, FREQUENCIES)
    return Analysis(
        run,
        config,
        own,
        others,
        describe(predicted, support, period),
        describe(measured, support, period),
        {name: compute_spectrum(by_sample[sample], frequencies, period) for name, sample in places.items()},
        guarded,
    )
