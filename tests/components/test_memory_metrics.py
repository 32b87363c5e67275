"""What learning leaves in memory is watched cycle by cycle, from the weights themselves."""

import numpy as np
import pandas as pd
import pytest

from cmacexp.commands.score import score
from cmacexp.data.tables import MEMORY, METRICS, METRICS_CSV
from cmacexp.experiment.run import run_scenario
from cmacexp.feedforward.weight_log import LOGGED, MOST_CYCLES
from cmacexp.loop import stream
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.registry import ALL_METRICS

SHORT = ("gait.cycle_time=0.5", "gait.lift=0.11")
"""A gait of 100 steps a cycle, of which more cycles than a log has room for would fit into memory at a time."""


def weights_after(config, *, fused=True):
    """What is logged of the weights cycle by cycle, (cycles, L, 3), and the weights at the end."""
    scenario = make_scenario(config)
    logged = []
    stream(
        scenario,
        lambda samples: logged.append(np.stack([samples.memory[name] for name in LOGGED], axis=2)),
        fused=fused,
    )
    return np.concatenate(logged), scenario.feedforward.params.weights


def summed_up(weights):
    """The same of the weights (L, rows, 2) themselves."""
    largest = np.abs(weights).max(axis=(1, 2))
    return np.stack([np.sqrt((weights**2).sum(axis=(1, 2))), largest, (weights != 0).any(axis=2).sum(axis=1)], axis=1)


@pytest.mark.parametrize("overrides", [["scenario=one_leg"], ["scenario=quadruped"]], ids=lambda o: o[0])
@pytest.mark.parametrize("fused", [True, False], ids=["fused", "step by step"])
def test_each_cycle_tells_the_weights_that_it_ended_with(make_config, overrides, fused):
    short = (*overrides, "learning.start_cycle=1")
    logged, _ = weights_after(make_config(*short, "cycles=2"), fused=fused)
    for cycles in (1, 2):
        _, weights = weights_after(make_config(*short, f"cycles={cycles}"), fused=fused)
        np.testing.assert_allclose(logged[cycles - 1], summed_up(weights), rtol=1e-13)


def test_no_cycle_is_lost_where_more_are_run_than_a_log_holds(make_config):
    cycles = MOST_CYCLES + 6
    logged, weights = weights_after(make_config(*SHORT, f"cycles={cycles}", "learning.lead=1"))
    assert len(logged) == cycles
    before, _ = weights_after(make_config(*SHORT, f"cycles={MOST_CYCLES}", "learning.lead=1"))
    np.testing.assert_array_equal(logged[:MOST_CYCLES], before)
    np.testing.assert_allclose(logged[-1], summed_up(weights), rtol=1e-13)


def test_before_a_network_learns_its_memory_is_empty(make_config):
    logged, _ = weights_after(make_config("cycles=5", "learning.start_cycle=4"))
    assert (logged[:3] == 0.0).all()
    assert (logged[3:] > 0.0).all()


def test_metrics_and_score_tell_the_same_of_memory(make_config, tmp_path):
    config = make_config("scenario=quadruped", "cycles=4", "record=trace")
    result = run_scenario(config, tmp_path)
    metrics, memory = (pd.read_parquet(tmp_path / name) for name in (METRICS, MEMORY))
    used = [leg["rows_used"] / leg["rows"] for leg in result.manifest["memory"]]
    last = metrics[metrics["cycle"] == 4]
    assert last["memory_used"].tolist() == used
    assert last["cells_colliding"].tolist() == [leg["cells_colliding"] for leg in result.manifest["memory"]]
    assert metrics["weight_norm"].tolist() == memory["weight_norm"].tolist()
    assert (metrics[metrics["cycle"] == 1]["weight_norm"] == 0.0).all()
    assert set(result.manifest["files"]) >= {MEMORY, METRICS, METRICS_CSV}
    score(tmp_path)
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / METRICS), metrics)


def test_a_run_that_ends_in_a_cycle_tells_the_weights_it_ended_with(make_config):
    logged, weights = weights_after(make_config("cycles=400", "learning.lead=-2"))
    assert len(logged) < 400
    np.testing.assert_allclose(logged[-1], summed_up(weights), rtol=1e-13)


@pytest.mark.parametrize("feedforward", ["none", "inverse_dynamics"])
def test_without_weights_nothing_is_told_of_them(make_config, tmp_path, feedforward):
    run_scenario(make_config(f"feedforward={feedforward}", "cycles=2", "record=trace"), tmp_path)
    metrics = pd.read_parquet(tmp_path / METRICS)
    assert metrics[["weight_norm", "memory_used", "cells_colliding"]].isna().all(axis=None)
    assert not (tmp_path / MEMORY).exists()


def test_memory_is_used_up_where_every_row_is():
    measure = ALL_METRICS["memory_used"].compute
    rows = np.array([4.0, 8.0, 8.0])
    np.testing.assert_allclose(measure({"rows": rows, "rows_used": np.array([4.0, 8.0, 2.0])}), [1.0, 1.0, 0.25])
