"""Panels of results: a metric over cycles or over a setting, a series for each value of another setting."""

from collections.abc import Callable

from cmacexp.report import curves
from cmacexp.report.figures import Panel
from cmacexp.study.interval import estimate
from cmacexp.study.results import Results
from cmacexp.typing import Array


def over_cycles(results: Results, name: str, by: str, log: str = "", title: str = "") -> Panel:
    """A metric in every cycle: the median over runs with the same value of ``by``, and their range as a band.

    ``title`` replaces the metric's own.
    """
    return curves.over_cycles(
        name, {value: group.history(name) for value, group in results.by(by).items()}, log, title
    )


def _interval(sample: Array) -> tuple[float, float, float]:
    found = estimate(sample)
    return found.value, found.low, found.high


def over_setting(
    results: Results,
    key: str,
    y: str,
    sample: Callable[[Results], Array],
    by: str | None = None,
    *,
    title: str = "",
    log: str = "",
    kind: str = "lines",
    axis: str = "",
    place: Callable[[Results], float] | None = None,
) -> Panel:
    """An estimate with its interval, if the sample has a spread, against a setting; none where it is infinite.

    Args:
        results: to draw.
        key: setting on the x axis; of bars, whose groups are in the order of the runs, it need not be numeric.
        y: name and unit of the y axis.
        sample: a value for each run.
        by: a setting with a series for each of its values.
        title: of the panel.
        log: logarithmic axes.
        kind: of the panel.
        axis: name and unit of the x axis, if not ``key``.
        place: on the x axis of runs with one value of the setting, if not the value itself.
    """
    groups = {
        name: {place(part) if place else value: sample(part) for value, part in group.by(key).items()}
        for name, group in (results.by(by) if by else {"": results}).items()
    }
    x = axis or ("" if kind == "bars" else key)
    return curves.over_setting(groups, x, y, _interval, kind=kind, log=log, title=title, order=results.values(key))
