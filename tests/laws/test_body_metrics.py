"""Laws of the metrics of a body."""

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmacexp.data.signals import TRUE_MARGINS
from cmacexp.metrics.body import compute_body

COLUMNS = ("height", "pitch", "roll", "stability_margin", "margin_front", "margin_rear", *TRUE_MARGINS)


def drawn(seed, rows):
    rng = np.random.default_rng(seed)
    return pa.table({name: rng.normal(size=rows) for name in COLUMNS})


@given(st.integers(0, 2**32 - 1), st.integers(8, 21))
def test_metrics_of_a_body_are_those_of_each_cycle_alone(seed, rows):
    """Of a last cycle that is short too."""
    body = drawn(seed, rows)
    found = compute_body(body, 7, first_cycle=3)
    assert found["cycle"].to_pylist() == list(range(3, 3 + -(-rows // 7)))
    for cycle, start in enumerate(range(0, rows, 7)):
        alone, metrics = body.slice(start, 7).to_pandas(), found.slice(cycle, 1).to_pydict()
        assert metrics["height_mean"][0] == pytest.approx(alone["height"].mean())
        assert metrics["height_min"][0] == alone["height"].min()
        assert metrics["height_max"][0] == alone["height"].max()
        assert metrics["tilt_max"][0] == max(alone["pitch"].abs().max(), alone["roll"].abs().max())
        for margin in COLUMNS[3:]:
            assert metrics[f"{margin}_min"][0] == alone[margin].min()


def test_cycles_count_from_1_unless_another_is_the_first():
    assert compute_body(drawn(0, 15), 7)["cycle"].to_pylist() == [1, 2, 3]
