"""Tables of results: a row for each group of runs."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

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
        columns: functions by the titles of further columns.
    """
    import pandas as pd

    groups: list[tuple[dict[str, Any], Results]] = [({}, results)]
    for key, title in by.items():
        groups = [({**names, title: value}, own) for names, part in groups for value, own in part.by(key).items()]
    return pd.DataFrame(names | {title: compute(own) for title, compute in columns.items()} for names, own in groups)
