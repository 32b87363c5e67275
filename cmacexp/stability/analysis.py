"""The stability analysis of one run: its growth, that of other leads, and the reasons; measured in memory."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.data.stored_run import StoredRun, read_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import (
    GROWTH_CYCLES,
    MAX_CYCLES_BEFORE,
    SETTLING_CYCLES,
    Growth,
    calmest,
    change_sizes,
    fitted_growth,
    predicted_growth,
    with_lead,
)
from cmacexp.stability.transfer import Spectrum, compute_spectrum, locals_along
from cmacexp.stability.verdict import MAX_CYCLES
from cmacexp.typing import Array

LEADS = (-2, -1, 0, 1, 2, 3)
MAX_CYCLES_IN_MUJOCO = 200
"""Cycles that are run at most where they take a hundred times as long."""
MIN_GROWTH_RATIO = 2.0
"""A change at least this many times the least one counts as growth."""
SHARE_LEFT_OUT = 0.05
"""Share of the cycles that are left out at the end of a run that did not complete: nothing is small there."""
LOWEST_FREQUENCY = 1.0
"""Lowest frequency of T, Hz; the highest is half the sampling rate."""
FREQUENCIES = 200
"""Number of frequencies at which T is computed."""
STEPS_AFTER_LIFT_OFF = 5
"""Samples after lift-off where T is computed: the foot has left the ground."""


class Stretch(NamedTuple):
    """The cycles over which growth is read."""

    calm: int
    """The cycle before them where the loop is linearised, in cycles done."""
    first: int
    last: int


def stretch(sizes: Sequence[float] | Array, first: int, completed: bool) -> Stretch:
    """Choose where to read growth: from the calmest cycle on if changes grow after it, else early on.

    Args:
        sizes: (n,), of the change from each cycle to the next, the first that of cycle 1.
        first: cycle in which the feedforward begins to act.
        completed: whether the run reached its end.
    """
    last = len(sizes) if completed else len(sizes) - max(2, round(SHARE_LEFT_OUT * len(sizes)))
    calm = calmest(sizes[:last], first) if last > first else first
    grows = last > calm and bool(sizes[last - 1] > MIN_GROWTH_RATIO * sizes[calm - 1])
    if not grows:
        calm = min(first + MAX_CYCLES_BEFORE, (first + last) // 2)
    start = calm + SETTLING_CYCLES if last > calm + 2 * SETTLING_CYCLES else calm + 1
    return Stretch(calm, start, min(start + GROWTH_CYCLES, last))


def growth_over(sizes: Sequence[float] | Array, place: Stretch) -> float:
    """Growth per cycle of the changes over a stretch; NaN where it is too short."""
    return fitted_growth(sizes[place.first - 1 : place.last])


@dataclass(frozen=True)
class LeadGrowth:
    """Growth with one lead; NaN where it is not defined."""

    lead: int
    place: Stretch
    sizes: Sequence[float]
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

    config: Config
    own: LeadGrowth
    leads: Sequence[LeadGrowth]
    """That of the run among them."""
    places: dict[str, Spectrum]
    """T at a few places of the first leg's cycle."""

    @property
    def tried(self) -> list[int]:
        """The leads, samples."""
        return [each.lead for each in self.leads]

    def least_real(self, lead: int) -> float:
        """Least Re T over all frequencies and those places."""
        return min(spectrum.least(lead) for spectrum in self.places.values())


def _run_lead(lead: int, config: Config, cycles: int) -> LeadGrowth:
    """Run so many cycles in memory without the guard of learning, measure growth, and predict it."""
    other = with_lead(config, lead)
    sizes = change_sizes(other, cycles)
    completed = len(sizes) == cycles - 1
    if len(sizes) <= config.learning.start_cycle:
        return LeadGrowth(lead, Stretch(1, 1, 1), sizes, completed, None, f"ends in cycle {len(sizes) + 2}")
    place = stretch(sizes, config.learning.start_cycle, completed)
    try:
        return LeadGrowth(lead, place, sizes, completed, predicted_growth(other, place.calm))
    except NotPredictable as error:
        return LeadGrowth(lead, place, sizes, completed, None, str(error))


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


def analyse(config: Config) -> Analysis:
    """Linearise the loop of a run, and compare its prediction with what the run gives without the guard of learning.

    Args:
        config: of the run, see :func:`read_learning`.

    Raises:
        NotPredictable: it is too short, does not learn, or its loop cannot be linearised.
    """
    scenario = make_scenario(config)
    lead, first = scenario.setup.lead, config.learning.start_cycle
    is_quick = isinstance(scenario.plant, AnalyticPlant)
    cycles = min(config.cycles, MAX_CYCLES if is_quick else MAX_CYCLES_IN_MUJOCO)
    own = _run_lead(lead, config, cycles)
    if len(own.sizes) < first + 3:
        raise NotPredictable(f"growth is measured over at least {first + 4} cycles; run more")
    if own.growth is None:
        raise NotPredictable(own.why_not)
    leads = sorted({*LEADS, lead}) if is_quick else [lead]
    period, places = config.sampling_period, choose_samples(scenario.setup.plan.support)
    by_sample = {local.sample: local for local in locals_along(config, own.place.calm, list(places.values()))}
    frequencies = np.linspace(min(LOWEST_FREQUENCY, 0.05 / period), 0.5 / period, FREQUENCIES)
    return Analysis(
        config,
        own,
        [own if tried == lead else _run_lead(tried, config, cycles) for tried in leads],
        {name: compute_spectrum(by_sample[sample], frequencies, period) for name, sample in places.items()},
    )
