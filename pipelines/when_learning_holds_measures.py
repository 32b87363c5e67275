"""What the study of verdicts measures of one run: how it went, and what each criterion says of its config."""

from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.stored_run import StoredRun, read_config
from cmacexp.loop.scenario import make_scenario, resolve_lead
from cmacexp.metrics.drift import DRIFT_RATIO, LEAST
from cmacexp.models.trend import WINDOW
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import GROWTH_CYCLES, MAX_CYCLES_BEFORE, SETTLING_CYCLES, fitted_growth
from cmacexp.stability.transfer import Spectrum, spectra_along
from cmacexp.stability.verdict import FREQUENCIES, GROWS, HOLDS, MAX_CYCLES, PLACES, UNDECIDED, assess
from cmacexp.study.results import Measures
from cmacexp.typing import Array

SAID = {HOLDS: 1.0, UNDECIDED: 0.0, GROWS: -1.0}
"""What a criterion says, as a number."""
LINEAR = 0.2
"""Ratio to the lowest feedback up to which its change counts as small."""
ROUNDING = 1e-9
"""Ratio to its largest below which a change is rounding."""
FEWEST = 20
"""Cycles over which growth is measured at least."""


class Outcome(NamedTuple):
    """Of one run; a criterion gives a number of SAID, or NaN if it cannot be computed."""

    learns: float
    """1: feedback alone lasts until learning begins, else 0."""
    held: float
    """1: it completed, and its feedback ended below DRIFT_RATIO times its lowest level."""
    condition: float
    """Re(z^l T) > (beta / 2) |T|^2 at every frequency and place."""
    frequency: float
    """Re(z^l T) > 0 there."""
    cycle_map: float
    """Growth below 1 of the loop linearised after the first cycles."""
    simulation: float
    """Whether the first MAX_CYCLES hold."""
    verdict: float
    predicted: float
    """Growth per cycle with the verdict."""
    measured: float
    """Growth over the same cycles of the run; NaN where they are too few, or the change is not small."""
    late: float
    """Lead below that of ``learning.lead=auto``, samples."""


NOTHING = Outcome(0.0, *[float("nan")] * (len(Outcome._fields) - 1))


def _over_legs(run: StoredRun, name: str) -> Array:
    """(cycles,): root mean square of a metric over the legs."""
    return np.asarray(np.sqrt((run.metrics[name] ** 2).groupby(run.metrics["cycle"]).mean()))


def _held(levels: Array, cycles: int) -> bool:
    """Whether so many cycles of learning completed without growth of their level."""
    if len(levels) < cycles:
        return False
    medians = np.median(sliding_window_view(levels[:cycles], WINDOW), axis=1)
    return bool(medians[-1] < DRIFT_RATIO * max(medians.min(), LEAST * levels.max()))


def _measure_growth(changes: Array, lowest: float, cycle: int) -> float:
    """Growth over the cycles after ``cycle`` that its prediction is for; ``changes`` (n,) from that to the next."""
    after = changes[cycle + SETTLING_CYCLES - 1 :][: GROWTH_CYCLES + 1]
    small = (after < LINEAR * lowest) & (after > ROUNDING * changes.max(initial=0.0))
    return fitted_growth(after) if cycle and len(after) >= FEWEST and small.all() else float("nan")


@lru_cache(maxsize=2)
def spectra(folder: Path) -> list[Spectrum]:
    """T at the places of the cycle of a run; none where its loop without learning does not last."""
    config = read_config(StoredRun(folder))
    try:
        return spectra_along(config, config.learning.start_cycle + MAX_CYCLES_BEFORE, PLACES, FREQUENCIES)
    except NotPredictable:
        return []


def _margin(spectrum: Spectrum, lead: int, rate: float) -> float:
    """Least Re(z^l T) - (rate / 2) |T|^2 over frequency."""
    turned = np.exp(2j * np.pi * spectrum.frequencies * spectrum.period * lead)[:, None] * spectrum.eigenvalues
    return float((turned.real - 0.5 * rate * np.abs(turned) ** 2).min())


@lru_cache(maxsize=2)
def _assess(folder: Path) -> Outcome:
    run = StoredRun(folder)
    config = read_config(run)
    first = config.learning.start_cycle
    levels = _over_legs(run, "feedback_rms") if run.whole_cycles else np.empty(0)
    if len(levels) < first - 1:
        return NOTHING
    scenario, verdict, short = make_scenario(config), assess(config), assess(config, simulate=False)
    setup, automatic = scenario.setup, replace(config.learning, lead="auto")
    margins = [_margin(place, setup.lead, setup.rate) for place in spectra(folder)]
    reals = [place.least(setup.lead) for place in spectra(folder)]
    asked = min(MAX_CYCLES, config.cycles - first + 1)
    learning = levels[first - 1 :]
    changes = _over_legs(run, "feedback_change")[1:]
    return Outcome(
        1.0,
        float(_held(learning, config.cycles - first + 1)),
        _above(min(margins, default=np.nan), 0.0),
        _above(min(reals, default=np.nan), 0.0),
        _above(-short.growth, -1.0),
        SAID[HOLDS] if _held(learning, asked) else SAID[GROWS],
        SAID[verdict.verdict],
        verdict.growth,
        _measure_growth(changes, float(learning.min(initial=np.inf)), verdict.cycle),
        float(resolve_lead(replace(config, learning=automatic), scenario.sensors) - setup.lead),
    )


def _above(value: float, limit: float) -> float:
    return float("nan") if np.isnan(value) else SAID[HOLDS] if value > limit else SAID[GROWS]


def _read(run: StoredRun, name: str) -> float:
    return float(getattr(_assess(run.folder), name))


def _read_real(run: StoredRun, place: int) -> float:
    """Least Re z^l T over frequency at one place of the cycle, NaN where nothing learns."""
    if not _read(run, "learns") or not spectra(run.folder):
        return float("nan")
    return spectra(run.folder)[place].least(make_scenario(read_config(run)).setup.lead)


REALS = [f"real_{place}" for place in range(PLACES)]
MEASURES: Measures = {
    **{name: partial(_read, name=name) for name in Outcome._fields},
    **{name: partial(_read_real, place=place) for place, name in enumerate(REALS)},
}
