"""What figures show, in words and numbers, from the data that they draw."""

from collections.abc import Mapping, Sequence

import numpy as np

from cmacexp.metrics.registry import SHOWN
from cmacexp.metrics.text import format_number
from cmacexp.typing import Array

STEADY = 0.02
"""A smaller change, as part of the larger value, is called none."""
MOST = 4
"""Metrics that a sentence names at most."""


def join(parts: Sequence[str]) -> str:
    """Parts of a sentence, after a space; empty without any."""
    return f" {'; '.join(parts)}." if parts else ""


def _describe_range(name: str, first: float, last: float) -> str:
    """A metric with two values in the unit that is shown, e.g. ``x error 9.54 to 1.47 mm``."""
    return f"{SHOWN[name].title} {format_number(first)} to {format_number(last)} {SHOWN[name].unit}"


def describe_change(histories: Mapping[str, Array]) -> str:
    """How metrics, a value for each cycle, in SI units, changed from the first cycle to the last that define it."""
    parts: dict[str, list[str]] = {"Falls": [], "Rises": [], "Hardly changes": []}
    for name, values in histories.items():
        known = SHOWN[name].factor * values[np.isfinite(values)]
        if len(known) > 1:
            first, last = abs(known[0]), abs(known[-1])
            hardly = abs(last - first) <= STEADY * max(first, last)
            word = "Hardly changes" if hardly else "Falls" if last < first else "Rises"
            parts[word].append(_describe_range(name, known[0], known[-1]))
    return "".join(f" {word} from the first cycle to the last:{join(own)}" for word, own in parts.items() if own)


def describe_effect(groups: Mapping[str, Sequence[Array]]) -> str:
    """Which metrics a setting changes most, from their values for each value of the setting, in the unit shown."""
    means = {name: np.array([own.mean() for own in samples]) for name, samples in groups.items() if len(samples) > 1}
    effects = {name: float(np.ptp(own) / (np.abs(own).max() or 1.0)) for name, own in means.items()}
    most = sorted((name for name in effects if effects[name] > STEADY), key=lambda name: -effects[name])[:MOST]
    parts = [
        f"{_describe_range(name, *np.sort(means[name])[[0, -1]])} ({100 * effects[name]:.0f} %)" for name in most
    ]
    none = f" It changes none by more than {100 * STEADY:.0f} %." if effects else ""
    return f" It changes most:{join(parts)}" if most else none
