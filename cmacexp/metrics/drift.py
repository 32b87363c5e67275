"""Metrics of learning: drift, the events of its guard, and the weights at the end of each cycle.

Learning drifts if the feedback torque, which it should reduce, grows again. Drift is detected in the first cycle in
which both tests are positive: the last TREND_WINDOW cycles rise significantly, and their level has risen to
DRIFT_RATIO times its lowest value so far. A change of the ground that learning compensates, or sensor noise, does
not rise in as many pairs of cycles. The metrics of weights are computed from ``memory.parquet``.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.records import Drift
from cmacexp.data.signals import CLOCK, GUARD_STATES, MEMORY_SIGNALS
from cmacexp.data.tables import as_array
from cmacexp.data.trace import Trace
from cmacexp.metrics.metric import LARGEST, MEAN, NEITHER, RMS, SMALLEST, Metric, worst
from cmacexp.models.trend import SIGNIFICANT, TREND_WINDOW
from cmacexp.typing import Array

COLUMNS = [signal.name for signal in MEMORY_SIGNALS if signal.owner != CLOCK]
"""Columns of ``memory.parquet`` that the metrics are computed from."""


def join_memory(traces: Sequence[Trace], cycles: int, legs: int) -> dict[str, Array]:
    """Concatenate memory traces of consecutive cycles: signals (cycles, legs) by name; all NaN without traces."""
    if not traces:
        return {name: np.full((cycles, legs), np.nan) for name in COLUMNS}
    return {name: np.concatenate([trace[name] for trace in traces]) for name in COLUMNS}


_NO_WEIGHTS = "no weights that a built-in feedforward keeps"
_of_weights = partial(Metric, undefined=_NO_WEIGHTS, better=NEITHER)

MEMORY_METRICS: dict[str, Metric[Mapping[str, Array]]] = {
    "weight_norm": _of_weights(
        "N m",
        "Euclidean norm of all weights at the end of the cycle",
        compute=lambda m: m["weight_norm"],
        pooling=RMS,
    ),
    "memory_used": _of_weights(
        "",
        "rows of memory with a weight other than 0 at the end of the cycle, over all rows",
        compute=lambda m: m["rows_used"] / m["rows"],
        pooling=MEAN,
    ),
    "cells_colliding": Metric(
        "",
        "visited cells that share their row with another one by hashing",
        f"{_NO_WEIGHTS}, not a CMAC, or more cells than 64 bits count",
        lambda m: m["cells_colliding"],
        MEAN,
        NEITHER,
        source="Albus 1975",
    ),
    "guard_state": _of_weights(
        "",
        f"guard of learning at the end of the cycle: {GUARD_STATES}",
        compute=lambda m: m["guard"],
        pooling=LARGEST,
    ),
}


DRIFT_RATIO = 1.5
"""Smallest ratio of the feedback level to its lowest level so far that counts as drift."""
LEAST = 0.01
"""Ratio to its highest level below which the feedback is so small that its rise is harmless."""

_EARLIER, _LATER = np.triu_indices(TREND_WINDOW, 1)


def format_drift(drift: Drift, at_end: bool = False) -> str:
    """Format a drift in one line; ``at_end``: its growth is that of the last cycles, else that at its detection."""
    rate = f"{100.0 * abs(drift.growth - 1.0):.1f} % per cycle"
    end = " at the end" if at_end else ""
    grows = f" grows {rate}{end}" if drift.growth >= 1.0 else f";{end} it falls again, by {rate}"
    return (
        f"drift detected in cycle {drift.named}, started in cycle {drift.cycle} (feedback of leg {drift.leg}{grows})"
    )


class DriftDetector:
    """Both tests, applied to the feedback of L legs during a run, block by block of cycles."""

    def __init__(self, legs: int):
        self._logs = np.full((TREND_WINDOW - 1, legs), np.nan)
        """Logarithms of the feedback in the last TREND_WINDOW - 1 cycles."""
        self._level = np.zeros((0, legs))
        """Logarithm of the feedback level, the median of the last TREND_WINDOW cycles, by cycle, (cycles, L)."""
        self._rises = np.zeros((0, legs), dtype=bool)
        """Mask of cycles at whose end the last TREND_WINDOW cycles rise significantly, (cycles, L)."""
        self.first: Drift | None = None

    def add(self, feedback: Array) -> tuple[Array, Array]:
        """Test the next cycles of RMS feedback torques (cycles, L).

        Returns two arrays (cycles, L), NaN where undefined: the growth factor per cycle, and the number of the cycle
        in which a drift started.
        """
        if not len(feedback):  # of a run that took no step
            return feedback, feedback
        tested = len(self._level)
        growth = self._test_trend(feedback)
        started = self._test_level()[tested:]
        if self.first is None and len(detected := np.argwhere(~np.isnan(started))):
            cycle, leg = map(int, detected[0])
            self.first = Drift(
                cycle=int(started[cycle, leg]),
                leg=leg + 1,
                named=tested + cycle + 1,
                growth=float(growth[cycle, leg]),
            )
        return growth, started

    def _test_trend(self, feedback: Array) -> Array:
        """Test the last TREND_WINDOW cycles for a significant rise (Mann 1945); return its growth (Sen 1968)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.concatenate([self._logs, np.log(feedback)])
            windows = sliding_window_view(logs, TREND_WINDOW, axis=0)
            differences = windows[..., _LATER] - windows[..., _EARLIER]
            growth: Array = np.exp(np.median(differences / (_LATER - _EARLIER), axis=-1))
            rises = np.sign(differences).sum(axis=-1) >= SIGNIFICANT
        self._logs = logs[1 - TREND_WINDOW :]
        self._level = np.concatenate([self._level, np.median(windows, axis=-1)])
        self._rises = np.concatenate([self._rises, rises])
        return growth

    def _test_level(self) -> Array:
        """Find the cycle in which a drift started, for every cycle so far, (cycles, L); NaN before a drift.

        The level must rise, and must have risen to DRIFT_RATIO times its lowest value.
        """
        level = self._level
        middle = np.arange(1, len(level) + 1)[:, None] - TREND_WINDOW // 2
        lowest, highest = np.fmin.accumulate(level), np.fmax.accumulate(level)
        lowest_cycle = np.fmax.accumulate(np.where(level == lowest, middle, 0.0))
        risen = level > np.maximum(lowest, highest + np.log(LEAST)) + np.log(DRIFT_RATIO)
        return np.fmin.accumulate(np.where(self._rises & risen, lowest_cycle, np.nan))


def make_drift_entry(metrics: pa.Table) -> dict[str, int | float] | None:
    """Make the entry ``drift`` of a manifest from the table of leg metrics; None without drift.

    It holds the first drift of the run, with the growth in the last cycle.
    """
    cycle, leg, started, growth = (as_array(metrics, n) for n in ("cycle", "leg", "drift_cycle", "feedback_growth"))
    detected = np.flatnonzero(~np.isnan(started))
    if not len(detected):
        return None
    first = detected[0]
    last = growth[leg == leg[first]][-1]
    return vars(Drift(cycle=int(started[first]), leg=int(leg[first]), named=int(cycle[first]), growth=float(last)))


def read_drift_entry(entry: Mapping[str, Any] | None) -> Drift | None:
    """Read a drift from the manifest entry that :func:`make_drift_entry` makes."""
    return None if entry is None else Drift(**entry)


def format_event(event: Mapping[str, Any]) -> str:
    """Format an event of the guard: the torque that acts from then on, and the cause."""
    acts = f"the torque of cycle {event['restored']} acts" if event["restored"] else "only the feedback acts"
    return f"{acts} ({event['cause']})"


def describe_guard(manifest: Mapping[str, Any]) -> str:
    """Describe all events of the guard, and when learning resumed, in one line; empty without events."""
    events = [(event["cycle"], format_event(event)) for event in manifest["guard"]]
    resumed = [(event["cycle"], f"learns again with lead {event['lead']}") for event in manifest["lead_estimates"]]
    return "; ".join(f"cycle {cycle}: {text}" for cycle, text in sorted(events + resumed[1:]))


LEARNING: dict[str, Metric[Mapping[str, Array]]] = {
    "feedback_growth": worst(
        "",
        f"factor by which feedback_rms grows per cycle, over the last {TREND_WINDOW} cycles",
        f"the first {TREND_WINDOW - 1} cycles",
        lambda values: values["feedback_growth"],
        source="Sen 1968",
    ),
    "drift_cycle": Metric(
        "",
        f"cycle since which feedback_rms drifts: it rises, and has risen to {DRIFT_RATIO:g} times its lowest level",
        "no drift detected up to this cycle",
        lambda values: values["drift_cycle"],
        SMALLEST,
        NEITHER,
        source="rise: Mann 1945",
    ),
}
