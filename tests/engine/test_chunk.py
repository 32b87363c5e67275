"""Runs that are made and scored together are those that are made alone, to the bit, and count as many."""

import numpy as np
import pandas as pd
import pytest
from support.doors import CmacexpError
from support.robots import OWN

from cmacexp import run
from cmacexp.engine.chunk import run_chunk

SHORT = ("scenario=one_leg", "gait.cycle_time=0.5", "gait.stroke=0.02", "cycles=2")
NOISY = (*SHORT, "sensors=noisy_force", "actuator.delay=2")
MIXED = [
    [*SHORT, "learning.rate=0.4"],
    [*SHORT, "learning.rate=0.3"],
    [*SHORT, "learning.rate=auto"],
    [*SHORT, "learning.rate=0.2", "seed=5"],
    [*NOISY, "seed=1"],
    [*NOISY, "seed=1", "learning.rate=0.2"],
    [*SHORT, "terrain.stiffness=30", "seed=3"],
    [*SHORT, "feedforward=none"],
    [*SHORT, "cycles=3", "learning.guard=refine", "seed=4"],
    [*NOISY, "seed=2"],
    [*SHORT, "controller.velocity_gain=1e5"],
    [*SHORT, "gait.stroke=0.03", "feedforward=inverse_dynamics"],
]
GROUPS = {
    "scenario": ["one_leg", "one_leg", "quadruped", "quadruped_lasting", "force_step"],
    "sensors": ["perfect", "perfect", "encoders", "noisy_force", "force_stuck", "real"],
    "feedforward": ["cmac", "cmac", "rbf", "ilc", "inverse_dynamics", "none", "cmac_on_model"],
    "learning.rule": ["paper", "normalised", "leakage", "dead_zone", "zero_phase", "decaying_rate"],
    "learning.guard": ["none", "freeze", "refine"],
    "terrain": ["soft_flat", "patchy"],
    "plant": ["analytic", "analytic", "mujoco_leg", "mujoco_quadruped"],
    "force_control": ["stiffness", "damping", "explicit"],
    "cmac.addressing": ["hashed", "visited"],
    "cycles": ["1", "2", "3"],
    "controller.velocity_gain": ["20", "100", "3000", "1e5"],
    "learning.rate": ["0.1", "0.7", "1.9"],
    "payload.weight": ["0", "30"],
}


def compare(runs, folder):
    """The statuses of runs made together, which have the metrics of those made alone."""
    ends, table = run_chunk(runs, False, len(runs))
    assert table["cycle"].num_chunks == 1  # else each run is handed over with the metrics of all
    first = 0
    for number, (end, overrides) in enumerate(zip(ends, runs, strict=True)):
        alone = run([*overrides, "record=metrics", "warn=false"], folder / str(number))
        own = table.slice(first, end.rows).to_pandas()
        first += end.rows
        pd.testing.assert_frame_equal(own[list(alone.metrics.columns)], alone.metrics, check_exact=True)
        if (body := alone.scores.body) is not None:
            for name in body.column_names[1:]:
                assert np.array_equal(own.groupby("cycle")[name].first(), body[name], equal_nan=True), name
        assert end.status == alone.status, overrides
    return {end.status for end in ends}, ends


@pytest.mark.ci
def test_runs_that_are_made_together_have_the_metrics_of_those_made_alone(tmp_path):
    statuses, ends = compare(MIXED, tmp_path)
    assert {"completed", "diverged"} <= statuses
    assert len({end.result for end in ends}) == len(MIXED)


@pytest.mark.ci
def test_bodies_and_machines_of_several_kinds_are_made_together(tmp_path):
    walk = ["scenario=quadruped", "cycles=1"]
    robot = ["scenario=robot", "machine=mjcf", f"machine.path={OWN}", "cycles=1"]
    walks = [walk, [*walk, "seed=2"], [*walk, "payload.weight=300"], robot, [*robot, "seed=3"], [*SHORT]]
    assert "completed" in compare(walks, tmp_path)[0]


@pytest.mark.ci
def test_parts_of_a_run_that_is_handed_over_cycle_by_cycle_are_scored_as_one(tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text("from cmacexp.plants import AnalyticPlant as A\nclass Own(A): pass\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    compare([[*SHORT, "plant._target_=own.Own"], [*SHORT]], tmp_path)


@pytest.mark.nightly
def test_two_hundred_random_configs_give_what_they_give_alone(tmp_path):
    rng = np.random.default_rng(1997)
    runs, tried = [], 0
    while len(runs) < 400:
        tried += 1
        keys = rng.choice(list(GROUPS), size=5, replace=False)
        drawn = [f"{key}={rng.choice(GROUPS[key])}" for key in keys]
        overrides = [*drawn, f"seed={tried}", *(() if "cycles" in keys else ("cycles=2",))]
        try:
            run_chunk([overrides], False, 1)
        except CmacexpError:
            continue
        runs += [overrides, [*overrides, "learning.rate=0.4"]]
    statuses = set()
    for at in range(0, len(runs), 40):
        statuses |= compare(runs[at : at + 40], tmp_path / str(at))[0]
    assert {"completed", "diverged"} <= statuses
