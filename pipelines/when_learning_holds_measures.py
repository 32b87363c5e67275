"""Measures of the study of predictors for one run: its outcome, and the verdict of each predictor on its config."""

import math
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from cmacexp.addons.stability.growth import GROWTH_CYCLES, SETTLING_CYCLES, fitted_growth
from cmacexp.addons.stability.verdict import (
    GROWS,
    HOLDS,
    MAX_CYCLES,
    UNDECIDED,
    assess,
    compute_rise,
    find_least_real,
)
from cmacexp.data.run import read_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.drift import DRIFT_RATIO
from cmacexp.study import Array, Measures, Run

SAID = {HOLDS: 1.0, UNDECIDED: 0.0, GROWS: -1.0}
"""Verdicts of a criterion as numbers."""
LINEAR = 0.2
"""Largest change of the feedback, relative to the lowest feedback, that counts as small."""
ROUNDING = 1e-9
"""Changes below this ratio to the largest change are rounding errors."""
FEWEST = 20
"""Least number of cycles from which growth is measured."""


def _held(levels: Array, cycles: int) -> bool:
    """Check that ``cycles`` cycles of learning completed without a rise of the feedback ``levels`` (n,), N m."""
    return len(levels) >= cycles and compute_rise(levels[:cycles])[0] < DRIFT_RATIO


def _measure_growth(changes: Array, lowest: float, cycle: int) -> float:
    """Measure the growth per cycle over the cycles after ``cycle`` for which it was predicted.

    ``changes`` (n,) are those of the feedback from each cycle to the next, N m, ``lowest`` is the lowest feedback.
    NaN where changes are not small, or cycles are too few.
    """
    after = changes[cycle + SETTLING_CYCLES - 1 :][: GROWTH_CYCLES + 1]
    small = (after < LINEAR * lowest) & (after > ROUNDING * changes.max(initial=0.0))
    return fitted_growth(after) if cycle and len(after) >= FEWEST and small.all() else float("nan")


def _say(margin: float) -> float:
    """Convert the margin of a criterion to its verdict: HOLDS above 0, else GROWS; NaN stays NaN."""
    return math.nan if math.isnan(margin) else SAID[HOLDS] if margin > 0.0 else SAID[GROWS]


@lru_cache(maxsize=2)
def _measure(folder: Path) -> Mapping[str, float]:
    """Compute the measures of the run in a folder, by name; those that cannot be computed are missing."""
    run = Run(folder)
    config = read_config(run, trust=True)
    first = config.learning.start_cycle
    levels = run.pooled["feedback_rms"] if run.whole_cycles else np.empty(0)
    if len(levels) < first - 1:
        return {"learns": 0.0}
    setup = make_scenario(config).setup
    verdict = assess(config)
    short = assess(config, simulate=False)
    learning = levels[first - 1 :]
    cycles = config.cycles - first + 1
    # Re(z^l T) > s T^H T, Re the Hermitian part: s = beta / 2 in condition 1, beta (l + 1/2) in condition 2.
    margins = find_least_real(config, setup.lead, setup.rate / 2.0, setup.rate * (setup.lead + 0.5), 0.0)
    return {
        "learns": 1.0,  # the cycles with feedback only completed
        # It completed, and its feedback ended below DRIFT_RATIO times its least.
        "held": float(_held(learning, cycles)),
        **dict(zip(("condition_1", "condition_2", "frequency"), map(_say, margins), strict=True)),
        "cycle_map": _say(1.0 - short.growth),  # of the loop linearised after the first cycles
        "simulation": _say(_held(learning, min(MAX_CYCLES, cycles))),
        "verdict": SAID[verdict.verdict],
        "predicted": verdict.growth,
        "measured": _measure_growth(
            run.pooled["feedback_change"][1:], float(learning.min(initial=np.inf)), verdict.cycle
        ),
    }


def _read(run: Run, name: str) -> float:
    return _measure(run.folder).get(name, math.nan)


MEASURES: Measures = {
    name: partial(_read, name=name)
    for name in (
        "learns", "held", "condition_1", "condition_2", "frequency", "cycle_map", "simulation", "verdict",
        "predicted", "measured",
    )
}  # fmt: skip
"""Measures of a run; a criterion gives a number of SAID, or NaN if it cannot be computed."""
