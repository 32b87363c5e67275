"""Figures and tables of the comparison of feedforwards."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import Results
from pipelines.feedforwards_cost import relative_costs
from pipelines.feedforwards_kinds import (
    ALONE,
    CMAC,
    KEPT,
    LEARNERS,
    MODELS,
    cycles_to_tenth,
    error_at,
    plane_error,
    small_error,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CARRIED, ANEW = "carried over", "from nothing"
AXES = ("cycle", "transfer error, mm")


def _series(name: str, results: Results) -> Series:
    """The mean over seeds, and their range as a band."""
    errors = plane_error(results)
    errors = np.where(np.isfinite(errors), errors, np.nan)
    cycles = np.arange(1, errors.shape[1] + 1)
    band = (errors.min(axis=0), errors.max(axis=0)) if len(errors) > 1 else (None, None)
    return Series(name, cycles, errors.mean(axis=0), *band)


def draw_learning(results: Results) -> "Figure":
    """Transfer error over the cycles, a line for each feedforward."""
    lines = [_series(kind, results.select(kind=kind)) for kind in (*LEARNERS, *MODELS)]
    return draw([Panel("", *AXES, lines, log="xy", y_limits=[small_error(results)])], height=4.0)


def draw_changes(results: Results) -> "Figure":
    """Transfer error after each change, with what was learnt before it; for CMAC also from nothing."""
    panels = []
    for change, own in results.by("group").items():
        lines = [_series(ALONE, own.select(kind=ALONE))]
        lines += [_series(f"{kind}, {CARRIED}", own.select(kind=kind, start=CARRIED)) for kind in KEPT]
        lines.append(_series(f"{CMAC}, {ANEW}", own.select(kind=CMAC, start=ANEW)))
        panels.append(Panel(change, *AXES, lines, log="y"))
    return draw(panels)


def accuracy_table(results: Results, cycles: list[int], extra: tuple[str, str, float]) -> "pd.DataFrame":
    """Errors of every feedforward in some cycles, and when it has learnt; means over seeds.

    Args:
        results: of one group.
        cycles: to show.
        extra: name of a further metric, its title with its unit, and its factor.
    """
    import pandas as pd

    rows = []
    metric, title, factor = extra
    for kind, own in results.by("kind").items():
        row: dict[str, object] = {"feedforward": kind}
        for cycle in cycles:
            for side in ("x", "y"):
                row[f"{side}, cycle {cycle}, mm"] = 1e3 * own.at(cycle, f"transfer_rmse_{side}").mean()
        best = plane_error(own)
        row["least in the plane, mm"] = best.min(axis=1).mean()
        row["in cycle"] = float(np.median(best.argmin(axis=1) + 1))
        row["cycles to a tenth"] = cycles_to_tenth(results, kind).mean() if kind in LEARNERS else None
        row[f"force RMS, cycle {cycles[-1]}, N"] = own.at(cycles[-1], "force_rmse").mean()
        row[f"{title.partition(',')[0]}, cycle {cycles[-1]},{title.partition(',')[2]}"] = (
            factor * own.at(cycles[-1], metric).mean()
        )
        rows.append({**row, "ended early": f"{len(own) - sum(own.completed)} of {len(own)}"})
    return pd.DataFrame(rows).convert_dtypes(convert_integer=False)


def plane_table(results: Results, cycles: list[int]) -> "pd.DataFrame":
    """Transfer error in the plane of every feedforward, or of one at several rates; means over seeds."""
    import pandas as pd

    rows = [
        {
            "feedforward": kind,
            "rate": float(rate) if kind in LEARNERS else None,
            **{f"cycle {cycle}, mm": error_at(group, cycle).mean() for cycle in cycles},
        }
        for kind, own in results.by("kind").items()
        for rate, group in own.by("learning.rate").items()
    ]
    return pd.DataFrame(rows).convert_dtypes(convert_integer=False)


def cost_table(results: Results) -> "pd.DataFrame":
    """Bytes of weights of one leg, and time of a step against feedback alone."""
    import pandas as pd

    rows = []
    times = relative_costs(results)
    for kind in times.index:
        learns = kind in LEARNERS
        own = results.select(kind=kind)
        sizes = {name: float(own.measure(name).mean()) / 1024 if learns else None for name in ("held", "used")}
        rows.append(
            {
                "feedforward": kind, "weights, KB": sizes["held"], "of them used, KB": sizes["used"],
                "least time of a step": times["least"][kind], "median time of a step": times["median"][kind],
            }
        )  # fmt: skip
    return pd.DataFrame(rows).convert_dtypes(convert_integer=False)


def change_table(results: Results) -> "pd.DataFrame":
    """After each change: error of the first cycle, cycles to a tenth with what was learnt and without, last error."""
    import pandas as pd

    rows = []
    for change, own in results.by("group").items():
        alone = error_at(own.select(kind=ALONE), 1)[0]
        for kind in own.values("kind"):
            learns = kind in KEPT
            acting = own.select(kind=kind, start=CARRIED if learns else ANEW)
            needed = {
                f"cycles to a tenth, {start}": cycles_to_tenth(own, kind, start).mean() if learns else None
                for start in (CARRIED, ANEW)
            }
            first = error_at(acting, 1).mean()
            errors = {"cycle 1, mm": first, "over feedback alone, %": 100.0 * first / alone}
            last = {"last cycle, mm": plane_error(acting)[:, -1].mean()}
            rows.append({"change": change, "feedforward": kind, **errors, **needed, **last})
    return pd.DataFrame(rows).convert_dtypes(convert_integer=False)
