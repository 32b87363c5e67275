"""What the study of predictors measures of one run: how it went, and what each of them says of its config."""

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
"""What a criterion says, as a number."""
LINEAR = 0.2
"""Ratio to the lowest feedback up to which its change counts as small."""
ROUNDING = 1e-9
"""Ratio to its largest below which a change is rounding."""
FEWEST = 20
"""Cycles over which growth is measured at least."""


def _held(levels: Array, cycles: int) -> bool:
    """Whether so many cycles of learning completed, of the ``levels`` of learning, and did not rise."""
    return len(levels) >= cycles and compute_rise(levels[:cycles])[0] < DRIFT_RATIO


def _measure_growth(changes: Array, lowest: float, cycle: int) -> float:
    """Growth over the cycles after ``cycle`` that its prediction is for; ``changes`` (n,) from that to the next."""
    after = changes[cycle + SETTLING_CYCLES - 1 :][: GROWTH_CYCLES + 1]
    small = (after < LINEAR * lowest) & (after > ROUNDING * changes.max(initial=0.0))
    return fitted_growth(after) if cycle and len(after) >= FEWEST and small.all() else float("nan")


def _say(margin: float) -> float:
    """What a criterion says that is met where its margin is above 0; NaN if that cannot be computed."""
    return math.nan if math.isnan(margin) else SAID[HOLDS] if margin > 0.0 else SAID[GROWS]


@lru_cache(maxsize=2)
def _measure(folder: Path) -> Mapping[str, float]:
    """The measures of a run, without what cannot be computed."""
    run = Run(folder)
    config = read_config(run, trust=True)
    first = config.learning.start_cycle
    levels = run.pooled["feedback_rms"] if run.whole_cycles else np.empty(0)
    if len(levels) < first - 1:
        return {"learns": 0.0}
    scenario, verdict, short = make_scenario(config), assess(config), assess(config, simulate=False)
    lead, rate = scenario.setup.lead, scenario.setup.rate
    learning, asked = levels[first - 1 :], config.cycles - first + 1
    # Re(z^l T) > s T^H T, Re the Hermitian part: s = beta / 2 in condition 1, beta (l + 1/2) in condition 2.
    margins = find_least_real(config, lead, rate / 2.0, rate * (lead + 0.5), 0.0)
    changes, lowest = run.pooled["feedback_change"][1:], float(learning.min(initial=np.inf))
    return {
        "learns": 1.0,  # feedback only lasts until learning begins
        # It completed, and its feedback ended below DRIFT_RATIO times its least.
        "held": float(_held(learning, asked)),
        **dict(zip(("condition_1", "condition_2", "frequency"), map(_say, margins), strict=True)),
        "cycle_map": _say(1.0 - short.growth),  # of the loop linearised after the first cycles
        "simulation": _say(_held(learning, min(MAX_CYCLES, asked))),
        "verdict": SAID[verdict.verdict],
        "predicted": verdict.growth,
        "measured": _measure_growth(changes, lowest, verdict.cycle),  # NaN where it is not small, or cycles are few
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
"""A criterion gives a number of SAID, or NaN if it cannot be computed."""
