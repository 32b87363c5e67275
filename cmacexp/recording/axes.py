"""The axes of plots: wide enough to read their numbers, and with room for the legend beside the lines."""

from collections.abc import Iterable, Sequence

import numpy as np

from cmacexp.recording.run_view import RunView
from cmacexp.recording.series import Line, collect_series

ROOM = 0.15
"""Room for a number beyond its mark, as part of the distance of marks."""

Range = tuple[float, float]


def _value_range(lines: Sequence[Line]) -> Range | None:
    values = np.concatenate([line[1] for line in lines])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else None


def widen_range(low: float, high: float) -> Range:
    """A range with a margin in which the viewer puts a number on at least two marks, which are at powers of ten."""
    span = high - low or abs(high) or 1.0
    low, high = low - 0.05 * span, high + 0.05 * span
    mark = 10.0 ** np.ceil(np.log10((high - low) / 5.0))  # even a low plot has numbers at five marks
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
    if spans and max(spans) > 10.0 * min(spans):
        return None
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def find_times(views: Sequence[RunView]) -> Range:
    """The first and the last moment of some runs, s."""
    return min(float(view.time[0]) for view in views), max(float(view.time[-1]) for view in views)
