"""The stability analysis of one run: its growth, that of other leads, and the reasons."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from cmacexp.config import Config, to_config
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadRun, CmacexpError
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import AFTER, OVER, Growth, change_sizes, predicted_growth, with_lead
from cmacexp.stability.measured import Stretch, changes_of, growth_over, stretch
from cmacexp.stability.mode import Mode, describe
from cmacexp.stability.transfer import Spectrum, locals_along, spectrum_of
from cmacexp.typing import Array

LEADS = (-2, -1, 0, 1, 2, 3)
LONG_ENOUGH = 200
"""Cycles that other leads are run for, in memory."""
ALONG = 30
"""Samples of the cycle at which T is looked at."""
LOWEST = 1.0
"""Lowest frequency that is looked at, Hz; the highest is half the sampling rate."""
FINE, COARSE = 200, 50
"""Frequencies that are looked at in a few places, and along the cycle."""
DELAYS = (0, 1, 2)
"""Further samples between torque and joint that are tried."""
SOON = 5
"""Samples after lift-off where T is looked at: the foot has left the ground."""


@dataclass(frozen=True)
class OfLead:
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
        """Growth per cycle as it came."""
        return growth_over(self.sizes, self.place)

    @property
    def predicted(self) -> float:
        """Growth per cycle of the linearised loop over the same cycles."""
        return self.growth.over(self.place.first, self.place.last) if self.growth else float("nan")

    @property
    def eigenvalue(self) -> float:
        """The largest absolute value."""
        return float(abs(self.growth.eigenvalues()[0])) if self.growth else float("nan")


@dataclass(frozen=True)
class Analysis:
    """What was found of one run."""

    run: StoredRun
    config: Config
    own: OfLead
    """Measured in the run's trace."""
    leads: Sequence[OfLead]
    """Measured in memory, but that of the run."""
    predicted_mode: Mode
    """What the feedforward changes in the last cycle of the stretch, as predicted."""
    measured_mode: Mode
    """The same in the trace."""
    places: dict[str, list[Spectrum]]
    """T at a few places of the first leg's cycle, with each of DELAYS."""
    along: dict[int, Spectrum]
    """T along the cycle, by sample."""

    def least_real(self, lead: int, delay: int = 0) -> float:
        """Least Re T over all frequencies and those places."""
        return min(spectra[DELAYS.index(delay)].least(lead) for spectra in self.places.values())


def config_of(run: StoredRun) -> Config:
    """The config of a stored run, typed again.

    Raises:
        BadRun: it is of a version with other fields.
    """
    try:
        return to_config(OmegaConf.create(run.config))
    except CmacexpError as error:
        raise BadRun(f"{run.folder}: its config is not one of this version ({error}); run it again") from None


def _of_lead(
    lead: int, config: Config, sizes: Sequence[float] | Array, completed: bool, cycle: int | None = None
) -> OfLead:
    if len(sizes) <= config.learning.start_cycle:
        place = Stretch(1, 1, 1, False)
        return OfLead(lead, place, np.asarray(sizes), completed, None, f"ends in cycle {len(sizes) + 1}")
    place = stretch(sizes, config.learning.start_cycle, completed)
    if cycle is not None:
        place = Stretch(cycle, min(cycle + AFTER, len(sizes)), min(cycle + AFTER + OVER, len(sizes)), place.grows)
    try:
        return OfLead(lead, place, np.asarray(sizes), completed, predicted_growth(config, place.calm))
    except NotPredictable as error:
        return OfLead(lead, place, np.asarray(sizes), completed, None, str(error))


def _in_memory(lead: int, config: Config, cycles: int) -> OfLead:
    other = with_lead(config, lead)
    sizes = change_sizes(other, cycles)
    return _of_lead(lead, other, sizes, len(sizes) == cycles - 1)


def _shape(run: StoredRun, cycle: int, shape: tuple[int, int, int]) -> Array:
    """What the feedforward changed from ``cycle`` to the next, (N, L, 2), N m."""
    rows = run.cycles([cycle, cycle + 1]).sort_values(["step", "leg"])
    torques = [rows.loc[rows["cycle"] == c, ["tau_feedforward_1", "tau_feedforward_2"]] for c in (cycle, cycle + 1)]
    return np.asarray(torques[1].to_numpy() - torques[0].to_numpy()).reshape(shape)


def frequencies(period: float, count: int) -> Array:
    """``count`` frequencies from LOWEST to half the sampling rate, Hz; ``period`` is between samples, s."""
    return np.linspace(min(LOWEST, 0.05 / period), 0.5 / period, count)


def samples_of(support: Any) -> dict[str, int]:
    """Samples where T is told apart: after the first leg's lift-off, in mid transfer and in mid support."""
    own, n = support[:, 0], len(support)
    if own.all():
        return {"standing": n // 2}
    lift = int(np.flatnonzero(~own & np.roll(own, 1))[0])
    transfer = int((~own).sum())
    middle = lift + transfer + (n - transfer) // 2
    return {
        f"{SOON} samples after lift-off": (lift + SOON) % n,
        "mid transfer": (lift + transfer // 2) % n,
        "mid support": middle % n,
    }


def analyse(run: StoredRun, cycle: int | None = None, leads: Sequence[int] = LEADS) -> Analysis:
    """Linearise the loop of a stored run, and set what it predicts beside what came.

    Args:
        run: finished, in whatever way; its trace whole.
        cycle: where to linearise the run, in cycles done; None: where its feedback changed least.
        leads: leads that are tried beside that of the run.

    Raises:
        BadRun: the run cannot be read, is too short, or nothing learns in it.
    """
    config = config_of(run)
    sizes = changes_of(run)
    if len(sizes) < config.learning.start_cycle + 3:
        raise BadRun(f"{run.folder}: growth shows over {config.learning.start_cycle + 4} cycles at the least")
    scenario = make_scenario(config)
    lead = scenario.setup.lead
    own = _of_lead(lead, config, sizes, run.status == "completed", cycle)
    if own.growth is None:
        raise BadRun(f"{run.folder}: its learning cannot be predicted: {own.why_not}")
    enough = min(config.cycles, LONG_ENOUGH)
    others = [own if tried == lead else _in_memory(tried, config, enough) for tried in sorted({*leads, lead})]
    return _with_reasons(run, scenario, own, others)


def _with_reasons(run: StoredRun, scenario: Scenario, own: OfLead, others: Sequence[OfLead]) -> Analysis:
    assert own.growth is not None
    config, support = scenario.setup.config, scenario.setup.plan.support
    predicted = own.growth.changes(own.place.last - own.place.calm)[-1, 1]
    measured = _shape(run, own.place.last, own.growth.shape)
    period = config.sampling_period
    named = samples_of(support)
    step = max(1, len(support) // ALONG)
    wanted = sorted({*named.values(), *range(step // 2, len(support), step)})
    found = {local.sample: local for local in locals_along(config, own.place.calm, wanted)}
    return Analysis(
        run,
        config,
        own,
        others,
        describe(predicted, support, period),
        describe(measured, support, period),
        {
            name: [spectrum_of(found[sample], frequencies(period, FINE), period, delay) for delay in DELAYS]
            for name, sample in named.items()
        },
        {sample: spectrum_of(local, frequencies(period, COARSE), period) for sample, local in found.items()},
    )
