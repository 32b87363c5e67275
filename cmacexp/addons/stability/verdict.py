"""The verdict on learning (holds, grows, undecided), its reasons, and the verdicts with other leads.

A verdict follows from a simulation in memory and from the loop linearised where that simulation ends. The guard of
learning never acts here; lead and rate are those of the guarded run. The limits were chosen on 200 random
configurations of one leg; ``pipelines/when_learning_holds.py`` tests them on others.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.addons.stability.cycle_map import NotPredictable, RestorableLoop, make_restorable_loop
from cmacexp.addons.stability.growth import (
    GROWTH_CYCLES,
    MAX_CYCLES_BEFORE,
    Growth,
    History,
    change_sizes,
    find_calmest,
    linearise_cycle,
    predicted_growth,
    record_history,
    require_learning,
    with_lead,
)
from cmacexp.addons.stability.transfer import Spectrum, spectra_along
from cmacexp.config import Config
from cmacexp.data.run import Run, read_config
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.metrics.drift import DRIFT_RATIO, LEAST
from cmacexp.models.trend import TREND_WINDOW
from cmacexp.plants import AnalyticPlant
from cmacexp.protocols import HasSubsteps, offers
from cmacexp.sensors.config import ChannelsConfig
from cmacexp.typing import Array

HOLDS, GROWS, UNDECIDED = "holds", "grows", "undecided"
MAX_CYCLES = 1000
"""Largest number of simulated cycles of learning."""
AFFORDABLE = 1_200_000
"""Simulated steps times legs: a second of computation or less."""
AHEAD = 2000
"""Cycles over which predicted changes are summed."""
MAX_RITZ = 1.0005
"""Ritz value up to which learning holds."""
MAX_LEVEL = 1.7
"""Level of the feedback, relative to its lowest, up to which learning holds if all predicted changes add up."""
POSITIVE = 0.05
"""Least Re T from which MAX_IF_POSITIVE replaces MAX_LEVEL."""
MAX_IF_POSITIVE = 2.4
MIN_GROWTH = 1.003
"""Growth per cycle and Ritz value from which learning grows, where Re T is negative somewhere."""
BOUNDED_RULES = ("dead_zone", "e_modification", "decaying_rate")
"""Learning rules that bound growth, which the linearised loop does not show."""
PLACES = 12
"""Number of samples of the cycle at which T is computed."""
FREQUENCIES = 150
"""Number of frequencies of T, up to half the sampling rate."""
SEED = 0
"""Seed of the random start vector of the second Krylov space."""
LEADS = (-2, -1, 0, 1, 2, 3)
"""Leads that an analysis compares with the lead of the run, samples."""


class Verdict(NamedTuple):
    """Verdict on the learning of a run, with the fields of ``stability.json``."""

    verdict: str
    """``holds``, ``grows`` or ``undecided``."""
    growth: float
    """Growth factor per cycle of the change of the feedback; NaN if unknown."""
    lead: int
    """Lead of learning, samples."""
    reasons: tuple[str, ...]
    """Sentences with numbers and limits."""
    cycle: int = 0
    """Number of cycles completed where the growth begins."""
    ends: int = 0
    """Cycle in which the run ends without a guard; 0 if it ends in none of the simulated ones."""

    def describe(self) -> str:
        """Format the verdict and its reasons in one line."""
        return f"{self.verdict}: {' '.join(self.reasons)}"


def compute_rise(levels: Array) -> tuple[float, float]:
    """Compute the final level of the feedback relative to its lowest, and the lowest level, N m.

    ``levels`` (n,), N m, are those of the cycles of learning, n at least TREND_WINDOW. Levels are medians
    over TREND_WINDOW cycles.
    """
    medians = np.median(sliding_window_view(levels, TREND_WINDOW), axis=1)
    lowest = max(float(medians.min()), LEAST * float(levels.max()))
    return float(medians[-1]) / lowest, lowest


def assess(config: Config, simulate: bool = True) -> Verdict:
    """Judge whether the learning of a config holds; raises BadInput.

    Simulates the cycles that take about a second, at most MAX_CYCLES; only MAX_CYCLES_BEFORE if not ``simulate``.
    """
    scenario = make_scenario(config)
    try:
        return _assess(config, scenario, simulate)
    except NotPredictable as error:
        return Verdict(UNDECIDED, float("nan"), scenario.setup.lead, (f"{error}.",))


def _assess(config: Config, scenario: Scenario, simulate: bool) -> Verdict:
    """Judge a config as :func:`assess`; raises BadInput and NotPredictable."""
    loop = RestorableLoop(scenario)
    lead = scenario.setup.lead
    first = config.learning.start_cycle
    steps = loop.period * loop.samples.shape[2] * (config.plant.substeps if offers(config.plant, HasSubsteps) else 1)
    # With a loop.plant, MuJoCo, a cycle takes a hundred times as long.
    cycles = max(MAX_CYCLES_BEFORE, min(MAX_CYCLES, AFFORDABLE // steps) if simulate and loop.plant is None else 0)
    history = record_history(loop, first + cycles)
    completed = len(history.levels)
    NotPredictable.unless(completed >= first - 1, f"the run ends in cycle {completed + 1}, before learning shows")
    require_learning(loop)
    if completed < first + cycles:
        # Without start_from, whose weights would act from the first cycle on.
        off = replace(config.learning, start_cycle=completed + 2, start_from=None)
        NotPredictable.unless(
            len(record_history(make_restorable_loop(replace(config, learning=off)), completed + 1).levels)
            > completed,
            f"the run ends in cycle {completed + 1}, with feedback only as well",
        )
        growth, cycle = _growth_before(config, history)
        return Verdict(GROWS, growth, lead, (f"The run ends in cycle {completed + 1}.",), cycle, completed + 1)
    risen, lowest = compute_rise(np.array(history.levels[first - 1 :]))
    level = f"After {completed} cycles without a guard the feedback is {risen:.3g} times its lowest level"
    if risen >= DRIFT_RATIO:
        growth, cycle = _growth_before(config, history)
        return Verdict(GROWS, growth, lead, (f"{level} (grows from {DRIFT_RATIO:g}).",), cycle)
    if quantised := _find_quantised(config):
        reason = f"{quantised} is above 0: what is quantised cannot be linearised."
        return Verdict(UNDECIDED, float("nan"), lead, (f"{level}.", reason), completed)
    return _linearise(config, loop, lead, level, risen, lowest)


def _find_quantised(config: Config) -> str:
    """Return the key of the first sensor quantum above 0; empty if there is none."""
    channels = config.sensors.signals if isinstance(config.sensors, ChannelsConfig) else {}
    return next((f"sensors.{name}.quantum" for name, channel in channels.items() if channel.quantum), "")


def _growth_before(config: Config, history: History) -> tuple[float, int]:
    """Predict the growth of a run that grew, at its cycle with the smallest change; return growth and cycle.

    The growth is NaN if the run ended too early.
    """
    first = config.learning.start_cycle
    if len(history.sizes) <= first:
        return float("nan"), 0
    cycle = find_calmest(history.sizes, first)
    try:
        return predicted_growth(config, cycle).per_cycle, cycle
    except NotPredictable:
        return float("nan"), cycle


def find_least_real(config: Config, lead: int, *shares: float) -> list[float]:
    """Compute, for each share, the least eigenvalue of Re(z^lead T) - share T^H T over frequencies and samples.

    See :meth:`Spectrum.least_real`. NaN if the run ends before it can be linearised.
    """
    try:
        spectra = spectra_along(config, config.learning.start_cycle + MAX_CYCLES_BEFORE, PLACES, FREQUENCIES)
    except NotPredictable:
        return [float("nan")] * len(shares)
    return [min(spectrum.least(lead, share) for spectrum in spectra) for share in shares]


def _linearise(config: Config, loop: RestorableLoop, lead: int, level: str, risen: float, lowest: float) -> Verdict:
    """Judge a loop by its linearisation at the end of a simulation that did not drift.

    The feedback ends at ``risen`` times its ``lowest`` level, N m; ``level`` is the sentence that says so. Growth of
    the map may saturate by the rule, or by contacts in MuJoCo: there it gives no verdict *grows*.
    """
    (least_real,) = find_least_real(config, lead, 0.0)
    growth = ritz = reached = float("nan")
    with suppress(NotPredictable):
        change = linearise_cycle(loop)
        random = linearise_cycle(loop, seed=SEED)
        growth = change.per_cycle
        ritz = max(float(abs(space.krylov.eigenvalues()[0])) for space in (change, random))
        reached = risen + float(change.krylov.lengths(AHEAD).sum()) / lowest
    trusts_growth = loop.plant is None and config.learning.rule not in BOUNDED_RULES
    verdict = UNDECIDED
    allowed = MAX_IF_POSITIVE if least_real >= POSITIVE else MAX_LEVEL
    if ritz <= MAX_RITZ and reached <= allowed:
        verdict = HOLDS
    elif trusts_growth and min(growth, ritz) >= MIN_GROWTH and least_real < 0.0:
        verdict = GROWS
    reasons = (
        f"{level}.",
        f"Linearised there, its changes grow by a factor of {growth:.4f} per cycle; the largest Ritz value is "
        f"{ritz:.4f} (holds up to {MAX_RITZ:g}).",
        f"If all changes of {AHEAD} more cycles add up, it reaches {reached:.3g} times that level (holds up to "
        f"{MAX_LEVEL:g}; where Re T is positive, to {MAX_IF_POSITIVE:g}).",
        f"The least Re T is {least_real:.3f} (positive from {POSITIVE:g}).",
    )
    return Verdict(verdict, growth, lead, reasons, loop.cycles)


@dataclass(frozen=True)
class Analysis:
    """Stability analysis of one run, without the guard of learning."""

    lead: int
    """Lead of the run, samples."""
    verdicts: Mapping[int, Verdict]
    """Verdicts by lead, including the lead of the run."""
    growth: Growth
    """Growth predicted from an early cycle of the run."""
    sizes: Sequence[float]
    """(n,): simulated changes of the feedback from cycle to cycle, N m, up to the end of the prediction."""
    spectra: Sequence[Spectrum]
    """T at samples of the cycle, all at the same frequencies."""

    def least_real(self, lead: int) -> Array:
        """Compute the least eigenvalue of Re(z^lead T) over the samples, at each frequency."""
        return np.min([spectrum.least_real(lead) for spectrum in self.spectra], axis=0)


def read_learning(run: Run, trust: bool = False) -> Config:
    """Read the config of a run as :func:`read_config`; ``lead=estimate`` is replaced by the last estimate."""
    config = read_config(run, trust, "--trust")
    return with_lead(config, int(run.manifest["learning_lead"])) if config.learning.lead == "estimate" else config


def analyse(config: Config, verdict: Verdict) -> Analysis:
    """Judge other leads of a config, given its own ``verdict``, and linearise its loop at an early cycle.

    ``config`` as from :func:`read_learning`. Raises NotPredictable if nothing learns, the run ends too early, or the
    loop cannot be linearised.
    """
    growth = predicted_growth(config)
    is_quick = isinstance(make_scenario(config).plant, AnalyticPlant)  # with other plants each lead takes minutes
    leads = sorted({*LEADS, verdict.lead}) if is_quick else [verdict.lead]
    return Analysis(
        verdict.lead,
        {lead: verdict if lead == verdict.lead else assess(with_lead(config, lead)) for lead in leads},
        growth,
        change_sizes(config, growth.cycle + GROWTH_CYCLES),
        spectra_along(config, growth.cycle, PLACES, FREQUENCIES),
    )
