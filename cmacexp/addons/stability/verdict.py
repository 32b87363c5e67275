"""Whether learning holds, in three values: from a run in memory, and from the loop linearised where that run ends;
and the same with other leads, with the growth that is predicted and the reasons.

It is about learning itself, so the guard of learning never acts here; lead and rate are those of the guarded run.
Limits were chosen on 200 random settings of one leg; ``pipelines/when_learning_holds.py`` tests them on others.
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
    calmest,
    change_sizes,
    grow,
    predicted_growth,
    require_learning,
    watch,
    with_lead,
)
from cmacexp.addons.stability.transfer import Spectrum, spectra_along
from cmacexp.config import Config
from cmacexp.data.run import Run, read_config
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.metrics.drift import DRIFT_RATIO, LEAST
from cmacexp.models.trend import WINDOW
from cmacexp.plants import AnalyticPlant
from cmacexp.protocols import HasSubsteps, offers
from cmacexp.sensors.config import ChannelsConfig
from cmacexp.typing import Array

HOLDS, GROWS, UNDECIDED = "holds", "grows", "undecided"
MAX_CYCLES = 1000
"""Cycles of learning that are run at most."""
AFFORDABLE = 1_200_000
"""Steps of all legs that are run: a second or less."""
AHEAD = 2000
"""Cycles ahead over which changes are added up."""
MAX_RITZ = 1.0005
"""Largest Ritz value with which learning holds."""
MAX_LEVEL = 1.7
"""Ratio to its lowest level that the feedback may reach where learning holds, if all changes to come add up."""
POSITIVE, MAX_IF_POSITIVE = 0.05, 2.4
"""Least Re T from which it may reach more, and how much."""
MIN_GROWTH = 1.003
"""Growth per cycle and largest Ritz value from which learning grows, where Re T is negative somewhere."""
BOUNDED_RULES = ("dead_zone", "e_modification", "decaying_rate")
"""Rules that bound growth by themselves: the linearised loop does not contain it."""
PLACES, FREQUENCIES = 12, 150
"""Samples of the cycle, and frequencies up to half the sampling rate, at which T is computed."""
SEED = 0
LEADS = (-2, -1, 0, 1, 2, 3)
"""Those that an analysis compares with that of the run."""


class Verdict(NamedTuple):
    """Whether learning holds; its fields are the content of ``stability.json``."""

    verdict: str
    """``holds``, ``grows`` or ``undecided``."""
    growth: float
    """Factor from cycle to cycle by which the change of the feedback grows; NaN if it is not known."""
    lead: int
    """Lead of learning, samples."""
    reasons: tuple[str, ...]
    """Sentences, with numbers and limits."""
    cycle: int = 0
    """Cycles done where the growth begins."""
    ends: int = 0
    """Cycle in which the run ends without a guard, 0: in none of those that were run."""

    def describe(self) -> str:
        """The verdict and its reasons, in one line."""
        return f"{self.verdict}: {' '.join(self.reasons)}"


def compute_rise(levels: Array) -> tuple[float, float]:
    """Level of the feedback at the end of the cycles of learning over its lowest there, and that lowest level.

    ``levels`` (n,) are of these cycles alone, n at least WINDOW.
    """
    medians = np.median(sliding_window_view(levels, WINDOW), axis=1)
    lowest = max(float(medians.min()), LEAST * float(levels.max()))
    return float(medians[-1]) / lowest, lowest


def assess(config: Config, simulate: bool = True) -> Verdict:
    """Say whether the learning of a config holds; raises BadInput.

    As many cycles as take a second are run in memory, MAX_CYCLES at most; MAX_CYCLES_BEFORE if not ``simulate``.
    """
    scenario = make_scenario(config)
    try:
        return _assess(config, scenario, simulate)
    except NotPredictable as error:
        return Verdict(UNDECIDED, float("nan"), scenario.setup.lead, (f"{error}.",))


def _assess(config: Config, scenario: Scenario, simulate: bool) -> Verdict:
    loop, lead, first = RestorableLoop(scenario), scenario.setup.lead, config.learning.start_cycle
    steps = loop.period * loop.samples.shape[2] * (config.plant.substeps if offers(config.plant, HasSubsteps) else 1)
    compiled = loop.plant is None  # MuJoCo takes a hundred times as long
    cycles = max(MAX_CYCLES_BEFORE, min(MAX_CYCLES, AFFORDABLE // steps) if simulate and compiled else 0)
    history = watch(loop, first + cycles)
    done = len(history.levels)
    NotPredictable.unless(done >= first - 1, f"the run ends in cycle {done + 1}, before learning shows")
    require_learning(loop)
    if done < first + cycles:
        off = replace(config.learning, start_cycle=done + 2, start_from=None)  # weights act from the first cycle on
        NotPredictable.unless(
            len(watch(make_restorable_loop(replace(config, learning=off)), done + 1).levels) > done,
            f"the run ends in cycle {done + 1}, with feedback only as well",
        )
        growth, cycle = _growth_before(config, history)
        return Verdict(GROWS, growth, lead, (f"The run ends in cycle {done + 1}.",), cycle, done + 1)
    risen, lowest = compute_rise(np.array(history.levels[first - 1 :]))
    level = f"After {done} cycles without a guard the feedback is {risen:.3g} times its lowest level"
    if risen >= DRIFT_RATIO:
        growth, cycle = _growth_before(config, history)
        return Verdict(GROWS, growth, lead, (f"{level} (grows from {DRIFT_RATIO:g}).",), cycle)
    if quantised := _find_quantised(config):
        reason = f"{quantised} is above 0: what is quantised cannot be linearised."
        return Verdict(UNDECIDED, float("nan"), lead, (f"{level}.", reason), done)
    return _linearise(config, loop, lead, level, risen, lowest)


def _find_quantised(config: Config) -> str:
    """The key of a sensor's quantum; empty if there is none."""
    channels = config.sensors.signals if isinstance(config.sensors, ChannelsConfig) else {}
    return next((f"sensors.{name}.quantum" for name, channel in channels.items() if channel.quantum), "")


def _growth_before(config: Config, history: History) -> tuple[float, int]:
    """Growth per cycle after the calmest cycle of a run that grew, and that cycle; NaN if it ended too soon."""
    first = config.learning.start_cycle
    if len(history.sizes) <= first:
        return float("nan"), 0
    cycle = calmest(history.sizes, first)
    try:
        return predicted_growth(config, cycle).per_cycle, cycle
    except NotPredictable:
        return float("nan"), cycle


def find_least_real(config: Config, lead: int, *shares: float) -> list[float]:
    """Least Re(z^lead T) - share T^H T over frequency and place, for each share; see :meth:`Spectrum.least_real`.

    NaN where the loop without learning does not last.
    """
    try:
        spectra = spectra_along(config, config.learning.start_cycle + MAX_CYCLES_BEFORE, PLACES, FREQUENCIES)
    except NotPredictable:
        return [float("nan")] * len(shares)
    return [min(spectrum.least(lead, share) for spectrum in spectra) for share in shares]


def _linearise(config: Config, loop: RestorableLoop, lead: int, level: str, risen: float, lowest: float) -> Verdict:
    """The verdict where a run ends as it began, of feedback that has ``risen`` to so many times its ``lowest``.

    Growth of the map may end in a limit cycle of a rule, or of contacts in MuJoCo: then it is not trusted.
    """
    (least_real,) = find_least_real(config, lead, 0.0)
    growth = ritz = reached = float("nan")
    with suppress(NotPredictable):
        own, other = grow(loop), grow(loop, seed=SEED)
        growth = own.per_cycle
        ritz = max(float(abs(space.krylov.eigenvalues()[0])) for space in (own, other))
        reached = risen + float(own.krylov.lengths(AHEAD).sum()) / lowest
    trusts_growth = loop.plant is None and config.learning.rule not in BOUNDED_RULES
    verdict, allowed = UNDECIDED, MAX_IF_POSITIVE if least_real >= POSITIVE else MAX_LEVEL
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
    """The stability of one run, without the guard of learning."""

    lead: int
    """Lead of the run, samples."""
    verdicts: Mapping[int, Verdict]
    """Verdicts by lead, that of the run among them."""
    growth: Growth
    """Predicted from an early cycle of the run."""
    sizes: Sequence[float]
    """(n,): changes of the feedback from cycle to cycle in memory, up to the end of the prediction, N m."""
    spectra: Sequence[Spectrum]
    """T at places of the cycle, at the same frequencies."""

    def least_real(self, lead: int) -> Array:
        """Least Re T over the places, at each frequency."""
        return np.min([spectrum.least_real(lead) for spectrum in self.spectra], axis=0)


def read_learning(run: Run, trust: bool = False) -> Config:
    """Read the config of a run as :func:`read_config`; of a lead that it estimated, with the last estimate."""
    config = read_config(run, trust, "--trust")
    return with_lead(config, int(run.manifest["learning_lead"])) if config.learning.lead == "estimate" else config


def analyse(config: Config, verdict: Verdict) -> Analysis:
    """Judge other leads of a run, of whose config :func:`read_learning` there is a verdict, and linearise its loop.

    Raises NotPredictable if it does not learn, ends before that shows, or its loop cannot be linearised.
    """
    growth = predicted_growth(config)
    is_quick = isinstance(make_scenario(config).plant, AnalyticPlant)  # on others each lead takes minutes
    leads = sorted({*LEADS, verdict.lead}) if is_quick else [verdict.lead]
    return Analysis(
        verdict.lead,
        {lead: verdict if lead == verdict.lead else assess(with_lead(config, lead)) for lead in leads},
        growth,
        change_sizes(config, growth.cycle + GROWTH_CYCLES),
        spectra_along(config, growth.cycle, PLACES, FREQUENCIES),
    )
