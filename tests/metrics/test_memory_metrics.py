"""What learning leaves in memory is watched cycle by cycle, from the weights themselves."""

import numpy as np
import pandas as pd
import pytest

import cmacexp

SHORT = ("gait.cycle_time=0.5", "gait.lift=0.11", "learning.lead=1")
"""A gait of 100 steps a cycle."""
MANY = 70
"""Cycles, more than a log of weights holds until it is taken."""


def last_of(run):
    """What the tables tell of the weights at the end, and the same of the weights (L, rows, 2) themselves."""
    memory = pd.read_parquet(run.folder / "memory.parquet")
    weights = np.load(run.folder / "weights.npz")["weights"]
    expected = [
        np.sqrt((weights**2).sum(axis=(1, 2))),
        np.abs(weights).max(axis=(1, 2)),
        (weights != 0).any(axis=2).sum(axis=1),
    ]
    told = memory[memory["cycle"] == memory["cycle"].max()]
    return told[["weight_norm", "weight_largest", "rows_used"]].to_numpy(), np.stack(expected, axis=1)


def test_the_tables_of_a_run_tell_the_weights_that_it_ended_with(leg):
    np.testing.assert_allclose(*last_of(leg), rtol=1e-13)
    norms = leg.metrics["weight_norm"].to_numpy()
    assert (norms[0], norms[-1] > 0.0) == (0.0, True), "the first cycle does not learn"
    (memory,) = leg.manifest["memory"]
    assert leg.metrics["memory_used"].iloc[-1] == memory["rows_used"] / memory["rows"]
    assert leg.metrics["cells_colliding"].iloc[-1] == memory["cells_colliding"]


@pytest.mark.ci
def test_no_cycle_is_lost_where_more_are_run_than_a_log_holds_or_a_run_ends_within_a_cycle(
    stored, tmp_path, compiled
):
    kept = (*SHORT, "record=trace", "record.weights=true")
    many, fewer = (cmacexp.run([*kept, f"cycles={n}"], tmp_path / str(n)) for n in (MANY, MANY - 10))
    norms = many.metrics["weight_norm"]
    assert (len(norms), (norms.diff()[1:] != 0.0).all()) == (MANY, True)
    np.testing.assert_array_equal(norms[: MANY - 10], fewer.metrics["weight_norm"])
    np.testing.assert_allclose(*last_of(many), rtol=1e-13)
    ended = stored("learning.lead=-2", "cycles=45", "record=trace", "record.weights=true")
    assert ended.status == "diverged"
    np.testing.assert_allclose(*last_of(ended), rtol=1e-13)
