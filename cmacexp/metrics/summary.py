"""What is shown of a run at first sight: its main metrics, those of several legs as one number."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import pyarrow as pa

from cmacexp.data.tables import Scores

Row = dict[str, Any]

MEAN, RMS, LARGEST = "mean", "rms", "largest"
SMALL, NEAR_ZERO, LARGE = "small", "near zero", "large"


class Shown(NamedTuple):
    """How a metric is shown."""

    title: str
    unit: str
    factor: float
    """From the unit of the file to ``unit``."""
    pool: str
    """How those of several legs become one."""
    good: str = ""
    """What is better: :data:`SMALL`, :data:`NEAR_ZERO` or :data:`LARGE`; empty if neither is."""


COLUMNS = {
    "transfer_rmse_x": Shown("transfer x", "mm", 1e3, RMS, SMALL),
    "transfer_rmse_y": Shown("transfer y", "mm", 1e3, RMS, SMALL),
    "force_rmse": Shown("force rmse", "N", 1.0, RMS, SMALL),
    "force_rmse_three_feet": Shown("three feet", "N", 1.0, RMS, SMALL),
    "force_settled": Shown("settled force", "N", 1.0, MEAN),
    "force_steady_state_error": Shown("error", "%", 100.0, MEAN, NEAR_ZERO),
    "force_overshoot": Shown("overshoot", "%", 100.0, LARGEST, SMALL),
    "force_settling_time": Shown("settling", "s", 1.0, LARGEST, SMALL),
    "force_itae": Shown("ITAE", "N s²", 1.0, MEAN, SMALL),
    "feedforward_share": Shown("feedforward", "%", 100.0, MEAN, LARGE),
    "tilt_max": Shown("tilt", "mrad", 1e3, LARGEST, SMALL),
    "height_mean": Shown("height", "mm", 1e3, MEAN),
    "margin_rear_min": Shown("rear margin", "mm", 1e3, MEAN),
}
"""The main metrics, in the order of tables."""
ONE_LEG_ONLY = ("force_settled", "force_steady_state_error", "force_overshoot", "force_settling_time", "force_itae")
"""Metrics that mean little over several legs, which are to press differently."""
MOST_ROWS = 24
"""A longer table shows its first and last rows."""


def pool(values: Sequence[float], how: str) -> float:
    """One number for several legs; NaN only if it is undefined for all of them."""
    values = [value for value in values if not math.isnan(value)]
    if not values:
        return math.nan
    if how == LARGEST:
        return max(values)
    if how == RMS:
        return math.sqrt(sum(value**2 for value in values) / len(values))
    return sum(values) / len(values)


def rows_per_cycle(scores: Scores) -> list[Row]:
    """One row per cycle: the main metrics pooled over the legs, with those of the body beside them, in SI units."""
    by_cycle: dict[int, list[Row]] = {}
    names = [name for name in COLUMNS if name in scores.legs.column_names]
    for row in scores.legs.select(["cycle", *names]).to_pylist():
        by_cycle.setdefault(row["cycle"], []).append(row)
    body = {row["cycle"]: row for row in scores.body.to_pylist()} if scores.body is not None else {}
    rows = []
    for cycle, legs in by_cycle.items():
        pooled: Row = {"cycle": cycle, **body.get(cycle, {})}
        for name in names:
            if not (len(legs) > 1 and name in ONE_LEG_ONLY):
                pooled[name] = pool([leg[name] for leg in legs], COLUMNS[name].pool)
        rows.append(pooled)
    return rows


def _pool_of(name: str) -> str:
    """How any metric of several legs becomes one."""
    if name in COLUMNS:
        return COLUMNS[name].pool
    if "rms" in name:
        return RMS
    return LARGEST if name.endswith(("_peak", "_time")) else MEAN


def all_of_cycle(scores: Scores, cycle: int) -> Row:
    """All metrics of one cycle, those of several legs as one number, in SI units."""
    tables = [table for table in scores if table is not None]
    legs, *body = ([row for row in table.to_pylist() if row["cycle"] == cycle] for table in tables)
    names = [name for name in scores.legs.column_names if name not in ("cycle", "leg")]
    pooled = {name: pool([leg[name] for leg in legs], _pool_of(name)) for name in names}
    return {**pooled, **{name: value for rows in body for name, value in rows[0].items() if name != "cycle"}}


def best(values: Sequence[float], good: str) -> float:
    """The best of some values; NaN if none is defined, or if there is no better or worse."""
    values = [value for value in values if not math.isnan(value)]
    if not values or not good:
        return math.nan
    if good == LARGE:
        return max(values)
    return min(values, key=abs) if good == NEAR_ZERO else min(values)


def defined(rows: Sequence[Mapping[str, float]]) -> dict[str, Shown]:
    """The main metrics that at least one row defines."""
    return {
        name: how for name, how in COLUMNS.items() if any(not math.isnan(row.get(name, math.nan)) for row in rows)
    }


def number(value: float) -> str:
    """A figure of a table; a dash where it is undefined."""
    if math.isnan(value):
        return "-"
    size = abs(value)
    return f"{value:.3f}" if size < 10 else f"{value:.1f}" if size < 1e5 else f"{value:.2e}"


def shorten(rows: Sequence[list[str]]) -> list[list[str]]:
    """The rows of a table, or of a long one the first and the last with dots between them."""
    if len(rows) <= MOST_ROWS:
        return list(rows)
    half = MOST_ROWS // 2
    return [*rows[:half], ["..."] + [""] * (len(rows[0]) - 1), *rows[-half:]]


def table_of_cycles(scores: Scores) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Titles and units, and the rows of the main metrics per cycle, without those that are undefined throughout."""
    rows = rows_per_cycle(scores)
    shown = defined(rows)
    cells = [[str(row["cycle"]), *(number(row[n] * how.factor) for n, how in shown.items())] for row in rows]
    return [("cycle", ""), *((how.title, how.unit) for how in shown.values())], shorten(cells)


def unit_of(table: pa.Table, name: str) -> tuple[str, str]:
    """Unit and meaning of a column, from its metadata; empty if it has none."""
    told = table.schema.field(name).metadata or {}
    return told.get(b"unit", b"").decode(), told.get(b"meaning", b"").decode()
