"""What the study of predictors measures of one run: how it went, and what each of them says of its config."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.data.run import Run, read_config
from cmacexp.loop.scenario import make_scenario, resolve_lead
from cmacexp.metrics.drift import DRIFT_RATIO
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import GROWTH_CYCLES, MAX_CYCLES_BEFORE, SETTLING_CYCLES, fitted_growth
from cmacexp.stability.transfer import Spectrum, spectra_along
from cmacexp.stability.verdict import FREQUENCIES, GROWS, HOLDS, MAX_CYCLES, PLACES, UNDECIDED, assess, compute_rise
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
    """1: feedback only lasts until learning begins, else 0."""
    held: float
    """1: it stayed bounded: it completed, and its feedback ended below DRIFT_RATIO times its lowest level."""
    condition_1: float
    """Re(z^l T) > (beta / 2) T^H T at every frequency and place, Re the Hermitian part."""
    condition_2: float
    """Re(z^l T) > beta (l + 1/2) T^H T there."""
    frequency: float
    """Re(z^l T) > 0 there."""
    cycle_map: float
    """Growth below 1 of the loop linearised after the first cycles."""
    simulation: float
    """Whether the first MAX_CYCLES stay bounded."""
    verdict: float
    predicted: float
    """Growth per cycle with the verdict."""
    measured: float
    """Growth over the same cycles of the run; NaN where they are too few, or the change is not small."""
    late: float
    """Lead below that of ``learning.lead=auto``, samples."""


REALS = [f"real_{place}" for place in range(PLACES)]
"""Names of the least eigenvalue of Re(z^l T) over frequency at each place of the cycle."""


def _over_legs(run: Run, name: str) -> Array:
    """(cycles,): root mean square of a metric over the legs."""
    return np.asarray(np.sqrt((run.metrics[name] ** 2).groupby(run.metrics["cycle"]).mean()))


def _held(levels: Array, cycles: int) -> bool:
    """Whether so many cycles of learning completed, of the ``levels`` of learning, and did not rise."""
    return len(levels) >= cycles and compute_rise(levels[:cycles])[0] < DRIFT_RATIO


def _measure_growth(changes: Array, lowest: float, cycle: int) -> float:
    """Growth over the cycles after ``cycle`` that its prediction is for; ``changes`` (n,) from that to the next."""
    after = changes[cycle + SETTLING_CYCLES - 1 :][: GROWTH_CYCLES + 1]
    small = (after < LINEAR * lowest) & (after > ROUNDING * changes.max(initial=0.0))
    return fitted_growth(after) if cycle and len(after) >= FEWEST and small.all() else float("nan")


def _spectra(config: Config) -> list[Spectrum]:
    """T at the places of the cycle; none where the loop without learning does not complete them."""
    try:
        return spectra_along(config, config.learning.start_cycle + MAX_CYCLES_BEFORE, PLACES, FREQUENCIES)
    except NotPredictable:
        return []


def _say(holds: bool) -> float:
    return SAID[HOLDS] if holds else SAID[GROWS]


def _say_if_met(spectra: Sequence[Spectrum], lead: int, share: float) -> float:
    """What Re(z^l T) > ``share`` T^H T at every frequency and place says; NaN without spectra."""
    return _say(min(place.least(lead, share) for place in spectra) > 0.0) if spectra else float("nan")


@lru_cache(maxsize=2)
def _measure(folder: Path) -> Mapping[str, float]:
    """Of a run: its Outcome and REALS; without what cannot be computed."""
    run = Run(folder)
    config = read_config(run)
    first = config.learning.start_cycle
    levels = _over_legs(run, "feedback_rms") if run.whole_cycles else np.empty(0)
    if len(levels) < first - 1:
        return {"learns": 0.0}
    scenario, verdict, short = make_scenario(config), assess(config), assess(config, simulate=False)
    setup, automatic, spectra = scenario.setup, replace(config.learning, lead="auto"), _spectra(config)
    reals = [place.least(setup.lead) for place in spectra]
    asked = min(MAX_CYCLES, config.cycles - first + 1)
    learning = levels[first - 1 :]
    changes = _over_legs(run, "feedback_change")[1:]
    outcome = Outcome(
        1.0,
        float(_held(learning, config.cycles - first + 1)),
        _say_if_met(spectra, setup.lead, setup.rate / 2.0),
        _say_if_met(spectra, setup.lead, setup.rate * (setup.lead + 0.5)),
        _say_if_met(spectra, setup.lead, 0.0),
        float("nan") if np.isnan(short.growth) else _say(short.growth < 1.0),
        _say(_held(learning, asked)),
        SAID[verdict.verdict],
        verdict.growth,
        _measure_growth(changes, float(learning.min(initial=np.inf)), verdict.cycle),
        float(resolve_lead(replace(config, learning=automatic), scenario.sensors, scenario.controller) - setup.lead),
    )
    return {**outcome._asdict(), **dict(zip(REALS, reals, strict=False))}


def _read(run: Run, name: str) -> float:
    return _measure(run.folder).get(name, float("nan"))


MEASURES: Measures = {name: partial(_read, name=name) for name in (*Outcome._fields, *REALS)}
