"""What figures show, in words and numbers, from the data that they draw."""

from collections.abc import Mapping, Sequence

import numpy as np

from cmacexp.metrics.metric import NEAR_ZERO
from cmacexp.metrics.registry import ALL_METRICS, SHOWN
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
    """How metrics, a value for each cycle, in SI units, changed from the first cycle to the last that define it.

    Of those that are best near 0 the sizes are compared.
    """
    parts: dict[str, list[str]] = {"fall": [], "rise": [], "hardly change": []}
    for name, values in histories.items():
        known = SHOWN[name].factor * values[np.isfinite(values)]
        if len(known) > 1:
            signed = ALL_METRICS[name].better == NEAR_ZERO
            first, last = np.abs(known[[0, -1]]) if signed else known[[0, -1]]
            hardly = abs(last - first) <= STEADY * max(abs(first), abs(last))
            verb = "hardly change" if hardly else "fall" if last < first else "rise"
            parts[verb].append("size of " * signed + _describe_range(name, first, last))
    said = {f"these {verb}" if len(own) > 1 else f"this {verb}s": own for verb, own in parts.items() if own}
    changes = "; ".join(f"{verb}: {', '.join(own)}" for verb, own in said.items())
    return f" From the first cycle to the last {changes}." if said else ""


def describe_effect(groups: Mapping[str, Sequence[Array]]) -> str:
    """Which metrics a setting changes most, from their values for each value of the setting, in the unit shown."""
    means = {name: np.array([own.mean() for own in samples]) for name, samples in groups.items() if len(samples) > 1}
    effects = {name: float(np.ptp(own) / (np.abs(own).max() or 1.0)) for name, own in means.items()}
    most = sorted((name for name in effects if effects[name] > STEADY), key=lambda name: -effects[name])[:MOST]
    parts = [
        f"{_describe_range(name, *np.sort(means[name])[[0, -1]])} ({100 * effects[name]:.0f} %)" for name in most
    ]
    none = f" It changes none by more than {100 * STEADY:.0f} %." if effects else ""
    repeated = any(len(own) > 1 for samples in groups.values() for own in samples)
    means_of = " (means over the runs with the same value)" if repeated else ""
    return f" It changes most{means_of}:{join(parts)}" if most else none
