"""Times of a log: their unit, their digits, and which of several clocks counts."""

import re

import numpy as np

from cmacexp.addons.gap.log import KEY
from cmacexp.addons.gap.names import SEPARATORS
from cmacexp.addons.gap.readers import is_number
from cmacexp.addons.gap.table import UNITS, Table
from cmacexp.errors import BadInput, require
from cmacexp.typing import Array

RATES = (2.0, 20_000.0)
"""Least and largest sampling rate of a log, Hz."""
USUAL = 8.0
"""Rate from which times without a unit count as seconds, Hz; other units come first for slower ones."""
CLOCKS = (0.05, 0.95)
"""Least ratio of the spans of two columns of times that could both be clocks, and that of clocks that agree."""
STEADY = 0.5
"""Least share of rows in which the time of a clock grows."""


def read_time(table: Table, notes: list[str]) -> Array | None:
    """Return the times (n,) from 0 on, s, without loss of digits; None if the log has none; raise BadInput.

    Without a unit, it is that of the column's name, or follows from the times, see :func:`_guess_unit`, which is
    added to ``notes``.
    """
    if (name := table.find("time", [""])) is None:
        return None
    _check_clocks(table, name)
    values = np.atleast_1d(table.columns[name])
    if values.dtype.kind == "M" or not is_number(values[0]):
        from pandas import to_datetime

        try:
            dates = to_datetime(values, format="mixed").to_numpy("datetime64[ns]")
        except (TypeError, ValueError) as error:
            raise BadInput(KEY, table.path, f"holds no times in column {name} ({error})") from error
        return np.asarray((dates - dates[0]) / np.timedelta64(1, "ns") * 1e-9)
    if values.dtype.kind not in "iu":
        values = table.get_numbers(name)
    ending = re.search(r"_(s|sec|ms|us|ns)_*$", name.translate(SEPARATORS), re.IGNORECASE)
    declared = next((unit for unit in table.list_declared() if unit in UNITS["time"]), None)
    unit = table.units.get("time") or declared or (ending and ending[1].lower().replace("sec", "s"))
    spans = np.asarray(values - values[0], dtype=float)
    if unit is None and (unit := _guess_unit(abs(float(values[0])), spans)) != "s":
        notes.append(f"Times in column {name} are in {unit}, as their size shows.")
    return spans * UNITS["time"][unit or "s"]


def _check_clocks(table: Table, name: str) -> None:
    """Require that no other column of times disagrees with that called ``name``, unless the user gave it."""
    if table.patterns["time"] == (name,):
        return
    own = table.columns[name]
    for other in (pattern for pattern in table.patterns["time"] if pattern in table.columns and pattern != name):
        values = table.columns[other]
        if own.dtype.kind not in "iuf" or values.dtype.kind not in "iuf" or values.shape != own.shape:
            continue
        spans = [float(np.ptp(clock[np.isfinite(clock)])) if len(clock) else 0.0 for clock in (own, values)]
        is_clock = (np.diff(values) > 0.0).mean() > STEADY if len(values) > 1 else False
        ratio = spans[1] / spans[0] if spans[0] > 0.0 else 1.0
        agrees = not CLOCKS[0] < ratio < 1.0 / CLOCKS[0] or CLOCKS[1] < ratio < 1.0 / CLOCKS[1]
        text = f"columns {name} and {other} say {spans[0]:.4g} and {spans[1]:.4g} s: say which one is right"
        require(agrees or not is_clock, KEY, table.path, f"{text}, --names time={other}, or time={name}")


def _guess_unit(first: float, spans: Array) -> str:
    """Return the unit of times: that of a ``first`` time since 1970, or the first in which rows have a usual rate.

    ``spans`` (n,) are times from the first one on. Seconds come first, and stand if no unit is likely.
    """
    sizes = {"ns": 1e17, "us": 1e14, "ms": 1e11}
    if since_1970 := [unit for unit, size in sizes.items() if first > size]:
        return since_1970[0]
    steps = np.diff(spans)
    period = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    rates = {unit: 1.0 / (factor * period) for unit, factor in UNITS["time"].items() if period > 0.0}
    return next((unit for unit, rate in rates.items() if USUAL <= rate <= RATES[1]), "s")
