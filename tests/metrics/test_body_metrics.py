"""Laws of the metrics of a body."""

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.doors import Trace

from cmacexp.metrics.body import compute_body

MARGINS = [f"{true}{name}" for true in ("", "true_") for name in ("stability_margin", "margin_front", "margin_rear")]
ROWS = 7
"""Of a cycle."""


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(8, 21))
def test_metrics_of_a_body_are_those_of_each_cycle_alone(seed, rows):
    """Of a last cycle that is short too; a margin that is unknown at times is the least of the others."""
    rng = np.random.default_rng(seed)
    body = {name: rng.normal(size=rows) for name in ("height", "pitch", "roll", *MARGINS)}
    for margin in MARGINS:
        body[margin][::3] = np.nan
    found = compute_body(Trace(pa.table(body)), ROWS, first_cycle=3).to_pydict()
    assert found.pop("cycle") == list(range(3, 3 + -(-rows // ROWS)))
    for cycle, start in enumerate(range(0, rows, ROWS)):
        alone = {name: values[start : start + ROWS] for name, values in body.items()}
        expected = {f"{margin}_min": np.nanmin(alone[margin]) for margin in MARGINS}
        expected |= {f"height_{name}": getattr(alone["height"], name)() for name in ("mean", "min", "max")}
        expected |= {"tilt_max": max(np.abs(alone[name]).max() for name in ("pitch", "roll"))}
        assert {name: values[cycle] for name, values in found.items()} == pytest.approx(expected, rel=1e-12)
