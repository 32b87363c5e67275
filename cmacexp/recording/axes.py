"""The axes of plots: wide enough to read their numbers, and with room for the legend beside the lines."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from cmacexp.recording.run_view import RunView
from cmacexp.recording.series import Line, collect_series

ALIKE = 10.0
"""Plots of several runs share their vertical axis unless the range of one is so many times that of another."""
SETTLED = 0.02
"""A line has settled where it stays within so much of its range around its last value."""
MOST_MARKS = 5.0
"""Marks at which even a low plot has numbers."""
ROOM = 0.15
"""Room for a number beyond its mark, as part of the distance of marks."""
LEGEND_ROOM = 0.3
"""Part of the time shown that is added on the right for the legend."""

Range = tuple[float, float]


def _value_range(lines: Sequence[Line]) -> Range | None:
    values = np.concatenate([line[1] for line in lines])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else None


def widen_range(low: float, high: float) -> Range:
    """A range with a margin in which the viewer puts a number on at least two marks, which are at powers of ten."""
    span = high - low or abs(high) or 1.0
    low, high = low - 0.05 * span, high + 0.05 * span
    mark = 10.0 ** np.ceil(np.log10((high - low) / MOST_MARKS))
    first, last = np.ceil(low / mark) * mark, np.floor(high / mark) * mark
    while last - first < 0.5 * mark:  # the nearest mark outside is taken in, with room for its number
        if low - first < last - high:
            first -= mark
            low = first - ROOM * mark
        else:
            last += mark
            high = last + ROOM * mark
    return low, high


def value_ranges(views: Sequence[RunView]) -> list[dict[str, Range]]:
    """The vertical axis of each plot of each run, by its name; where several runs have it, one that they share."""
    own = [
        {path: span for path, lines in collect_series(view).items() if (span := _value_range(lines))}
        for view in views
    ]
    shared = {path: _share([ranges[path] for ranges in own if path in ranges]) for path in set().union(*own)}
    return [{path: widen_range(*(shared[path] or span)) for path, span in ranges.items()} for ranges in own]


def _share(ranges: Iterable[Range]) -> Range | None:
    """The range that covers all, unless one dwarfs another."""
    ranges = list(ranges)
    spans = [high - low for low, high in ranges if high > low]
    if spans and max(spans) > ALIKE * min(spans):
        return None
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def settling_time(view: RunView) -> float:
    """Time from which on no line of a run moves any more, s; the end of the run if one does."""
    last = 0
    for lines in collect_series(view).values():
        span = _value_range(lines)
        for _, values, _ in lines:
            if span and span[1] > span[0]:
                away = np.flatnonzero(~(np.abs(values - values[-1]) <= SETTLED * (span[1] - span[0])))
                last = max(last, int(away[-1]) if len(away) else 0)
    return float(view.time[min(last + 1, len(view.time) - 1)])


class Times(NamedTuple):
    """The moments to look at, s."""

    first: float
    last: float
    end: float
    """Of the recording, at ``last`` or later."""

    @property
    def length(self) -> float:
        """From the first to the last moment."""
        return self.last - self.first


def find_times(views: Sequence[RunView]) -> Times:
    """All times of some runs; of step responses, which take one cycle, only until they have long settled."""
    first = min(float(view.time[0]) for view in views)
    end = last = max(float(view.time[-1]) for view in views)
    if all(not view.walks and view.window.first == view.window.last for view in views):
        last = min(end, first + 2.0 * (max(map(settling_time, views)) - first))
    return Times(first, last, end)
