"""Tables of results: a row for each group of runs."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.study.interval import estimate
from cmacexp.study.results import Results

if TYPE_CHECKING:
    import pandas as pd


def tabulate(
    results: Results, by: Mapping[str, str], columns: Mapping[str, Callable[[Results], Any]]
) -> "pd.DataFrame":
    """A row for each combination of settings that occurs: their values, and what functions give of its runs.

    Args:
        results: to tabulate.
        by: titles of columns, by the setting whose values they hold.
        columns: functions by the titles of further columns; of an array, a value for each run, the estimate is shown.
    """
    import pandas as pd

    groups: list[tuple[dict[str, Any], Results]] = [({}, results)]
    for key, title in by.items():
        groups = [({**names, title: value}, own) for names, part in groups for value, own in part.by(key).items()]
    return pd.DataFrame(
        names | {title: _show(compute(own)) for title, compute in columns.items()} for names, own in groups
    )


def cross_tabulate(
    results: Results, rows: tuple[str, str], columns: tuple[str, str], cell: Callable[[Results], Any]
) -> "pd.DataFrame":
    """A row for each value of one setting, a column for each value of another; ``cell`` shows the runs with both.

    ``rows`` are the first setting and the title of its column, ``columns`` the second and what its titles begin with.
    """
    values = {f"{columns[1]} {value}": {columns[0]: value} for value in results.values(columns[0])}
    found = {title: (lambda own, chosen=chosen: cell(own.select(chosen))) for title, chosen in values.items()}
    return tabulate(results, {rows[0]: rows[1]}, found)


def _show(value: Any) -> Any:
    """The estimate of a value for each run, NaN if there is none or one is undefined; anything else as it is."""
    if not isinstance(value, np.ndarray):
        return value
    return estimate(value).value if len(value) and not np.isnan(value).any() else np.nan


def completed(results: Results) -> str:
    """How many runs reached their end, e.g. ``2 of 3``."""
    return f"{sum(results.completed)} of {len(results)}"
