"""The quadruped walks (Lin & Song 1997, section 6): what it must show, both loops, symmetry, falls."""

import dataclasses
import itertools
import json
import os
import random
import re
import subprocess
import sys

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.command import cmacexp, python
from support.grounds import still_ground

from cmacexp.loop import roll_out
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.stop import (
    DIVERGED,
    FELL,
    LONGEST_TUMBLE,
    LOWEST_HIP,
    RUNNING,
    STEEPEST,
    describe_stop,
    new_guard,
    stop_reason,
)
from cmacexp.loop.trace import assemble
from cmacexp.metrics import compute
from cmacexp.planning.machine import make_mechanism

STEPS = 600
"""Of a cycle."""
PERIOD = 0.005
WEIGHT = 40.0
HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])
LIFT_OFF = (480, 180, 360, 60)
TOUCH_DOWN = (0, 300, 480, 180)
"""Samples of the cycle, by leg."""


class Run:
    """What a command left: its folder, its exit code, and its tables as arrays."""

    def __init__(self, folder, done):
        self.folder, self.code, self.done = folder, done.returncode, done
        self.manifest = json.loads((folder / "manifest.json").read_text())
        trace = pd.read_parquet(folder / "trace.parquet")
        assert trace.leg[:4].tolist() == [1, 2, 3, 4]
        self.trace = {name: trace[name].to_numpy().reshape(-1, 4) for name in trace.columns}
        self.body = pd.read_parquet(folder / "body.parquet")
        self.metrics = pd.read_parquet(folder / "metrics.parquet").set_index(["cycle", "leg"])
        self.body_metrics = pd.read_parquet(folder / "body_metrics.parquet").set_index("cycle")

    def of_cycle(self, name, cycle):
        """A column of the trace (600, 4) in one cycle."""
        return self.trace[name][(cycle - 1) * STEPS : cycle * STEPS]

    def transfer_rmse(self, axis, cycle):
        """Transfer error over all legs, m."""
        error = self.of_cycle(axis, cycle) - self.of_cycle(f"{axis}_desired", cycle)
        return np.sqrt((error[self.of_cycle("phase", cycle) == "transfer"] ** 2).mean())

    def share(self, cycle):
        """What the feedforward does of all torque, over all legs."""
        parts = [
            sum(np.abs(self.of_cycle(f"tau_{part}_{j}", cycle)).sum() for j in (1, 2))
            for part in ("feedforward", "feedback")
        ]
        return parts[0] / sum(parts)

    def pooled(self):
        """Root mean square over the legs of every metric, and the body's metrics, by cycle."""
        legs = (self.metrics**2).groupby(level="cycle").mean() ** 0.5
        return legs.join(self.body_metrics).dropna(axis=1, how="all")


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Runs of the command line, each once."""
    kept = {}

    def run(*overrides):
        if overrides not in kept:
            folder = tmp_path_factory.mktemp("walk")
            done = cmacexp("scenario=quadruped", *overrides, "record=trace", f"hydra.run.dir={folder}", folder=folder)
            assert done.returncode in (0, 3), done.stderr
            kept[overrides] = Run(folder, done)
        return kept[overrides]

    return run


ALL_THREE = ("cycles=20",)
FEEDBACK = ("feedforward=none",)
LITERAL = ("reference=literal",)
FALLING = ("posture.gain=0",)
FALLING_AT_ONCE = ("posture.gain=0", "feedforward=none")
PATCHY = ("terrain=patchy", "gait.load_ramp=0.1", "cycles=6")
WALKS = [ALL_THREE, FEEDBACK, LITERAL, PATCHY, FALLING]


# The plan, as the trace tells it


def test_longitudinal_margins_at_the_limits_are_a_twentieth_of_the_stride(walk):
    body, margin = walk(*ALL_THREE).body, 0.05 * 0.3 / 0.8
    assert body.margin_rear[360] == pytest.approx(margin, abs=1e-9)
    assert 2.0 * body.margin_front[299] - body.margin_front[298] == pytest.approx(margin, abs=1e-9)
    assert body[["margin_front", "margin_rear"]].min(axis=None) == pytest.approx(margin, abs=1e-9)


def test_desired_forces_balance_weight_and_moments_at_every_step(walk):
    trace = walk(*ALL_THREE).trace
    force = trace["force_desired"]
    assert_allclose(force.sum(axis=1), WEIGHT, atol=1e-9)
    assert_allclose((force * (HIPS[:, 0] + trace["x_desired"])).sum(axis=1), 0.0, atol=1e-9)
    assert_allclose((force * HIPS[:, 1]).sum(axis=1), 0.0, atol=1e-9)


# The plant


def feet_in_world(run):
    """Feet (steps, 4, 3) turned by roll about x, then by pitch about y, then lifted by the height."""
    trace, body = run.trace, run.body
    pitch, roll = (body[name].to_numpy()[:, None] for name in ("pitch", "roll"))
    x, y, z = HIPS[:, 0] + trace["x"], HIPS[:, 1], -trace["y"]
    left, up = y * np.cos(roll) - z * np.sin(roll), y * np.sin(roll) + z * np.cos(roll)
    ahead, up = x * np.cos(pitch) + up * np.sin(pitch), up * np.cos(pitch) - x * np.sin(pitch)
    return np.stack([ahead, left, body.height.to_numpy()[:, None] + up], axis=2)


@pytest.mark.parametrize("command", WALKS, ids=" ".join)
def test_contact_forces_balance_weight_and_moments_at_every_step(walk, command):
    run = walk(*command)
    force, feet = run.trace["force"], feet_in_world(run)
    assert_allclose(force.sum(axis=1), WEIGHT, atol=1e-6 * WEIGHT)
    assert_allclose((force[..., None] * feet[..., :2]).sum(axis=1), 0.0, atol=1e-6 * WEIGHT)


def test_contact_forces_are_those_of_the_depressed_ground(walk):
    run = walk(*ALL_THREE)
    assert_allclose(run.trace["force"], 1e4 * np.maximum(0.0, -feet_in_world(run)[..., 2]), atol=1e-8)


def steady(metrics):
    """Those that are of a cycle by itself; from one to the next a periodic walk changes by rounding alone."""
    return metrics.drop(columns=["feedback_change", "feedback_growth"])


def test_ten_substeps_change_no_metric_of_the_steady_walk_by_two_percent(walk):
    one, ten = walk(*FEEDBACK), walk(*FEEDBACK, "plant.substeps=10")
    assert_allclose(steady(ten.pooled().loc[2:]), steady(one.pooled().loc[2:]), rtol=0.02)
    assert_allclose(steady(ten.metrics.loc[2:]), steady(one.metrics.loc[2:]), rtol=0.02)


def test_ten_substeps_change_nothing_of_learning_by_two_percent_either(walk):
    one, ten = walk(*ALL_THREE).pooled().loc[:5], walk("cycles=5", "plant.substeps=10").pooled()
    assert_allclose(ten, one[ten.columns], rtol=0.02)


# With and without posture control


def test_feedback_alone_falls_within_a_second(walk):
    run = walk(*FALLING_AT_ONCE)
    assert run.code == 3
    assert run.manifest["status"] == "fell"
    assert run.manifest["steps"] * PERIOD <= 1.0


def test_feedback_and_cmac_without_posture_control_fall_too(walk):
    run = walk(*FALLING)
    assert (run.code, run.manifest["status"]) == (3, "fell")


def test_a_fall_keeps_trace_and_metrics_and_says_when_and_why(walk):
    run = walk(*FALLING)
    step, time = re.match(r"at step (\d+) \(t = ([\d.]+) s\): .+", run.manifest["cause"]).groups()
    assert int(step) == run.manifest["steps"] == len(run.body) == len(run.trace["x"])
    assert float(time) == pytest.approx(int(step) * PERIOD)
    assert f"fell {run.manifest['cause']}" in run.done.stdout
    assert np.isfinite(run.trace["force"]).all()
    assert run.body_metrics.tilt_max[1] > 0.2
    assert python("-m", "cmacexp.verify", str(run.folder), folder=run.folder).returncode == 0


def test_feedback_with_posture_control_walks_ten_cycles(walk):
    run = walk(*FEEDBACK)
    assert (run.code, run.manifest["status"], run.manifest["steps"]) == (0, "completed", 10 * STEPS)


def test_feedback_with_posture_control_is_periodic(walk):
    run = walk(*FEEDBACK)
    assert_allclose(steady(run.metrics.loc[10]), steady(run.metrics.loc[2]), rtol=1e-3)
    assert run.metrics.feedback_change.loc[10].max() < 1e-9
    assert_allclose(run.body_metrics.loc[10], run.body_metrics.loc[2], rtol=1e-3)


def test_feedback_walks_the_right_side_as_the_left_half_a_cycle_later(walk):
    run = walk(*FEEDBACK)
    for name in ("x", "y", "force", "tau_feedback_2"):
        left, right = run.of_cycle(name, 9)[:, [0, 2]], run.of_cycle(name, 9)[:, [1, 3]]
        assert_allclose(np.roll(left, STEPS // 2, axis=0), right, atol=1e-3 * np.abs(left).max())


# All three


def test_all_three_walk_twenty_cycles(walk):
    run = walk(*ALL_THREE)
    assert (run.code, run.manifest["status"], run.manifest["steps"]) == (0, "completed", 20 * STEPS)


@pytest.mark.parametrize(
    ("axis", "cycle", "limit"), [("x", 5, 8e-3), ("x", 10, 2e-3), ("y", 5, 22e-3), ("y", 10, 8e-3)]
)
def test_transfer_error_falls(walk, axis, cycle, limit):
    run = walk(*ALL_THREE)
    assert max(run.transfer_rmse(axis, later) for later in range(cycle, 21)) <= limit


def test_the_trace_s_transfer_error_is_that_of_the_metrics(walk):
    run = walk(*ALL_THREE)
    for axis in "xy":
        assert run.transfer_rmse(axis, 7) == pytest.approx(run.pooled()[f"transfer_rmse_{axis}"][7], rel=1e-12)


def test_the_feedforward_takes_over(walk):
    run = walk(*ALL_THREE)
    assert run.share(1) == 0.0
    assert run.share(2) >= 0.65
    assert min(run.share(cycle) for cycle in range(8, 21)) >= 0.8


@pytest.mark.parametrize(("cycle", "limit"), [(5, 75e-3), (10, 60e-3), (20, 15e-3)])
def test_the_body_levels_off(walk, cycle, limit):
    body = walk(*ALL_THREE).body
    tilt = body[body.cycle == cycle][["pitch", "roll"]].abs().max(axis=None)
    assert tilt <= limit
    assert walk(*ALL_THREE).body_metrics.tilt_max[cycle] == tilt


def test_the_body_keeps_its_height_from_cycle_8(walk):
    body = walk(*ALL_THREE).body
    assert (body[body.cycle >= 8].height - 0.5).abs().max() <= 10e-3


def test_on_three_feet_forces_are_as_desired_by_cycle_5(walk):
    pooled = walk(*ALL_THREE).pooled().force_rmse_three_feet
    assert pooled[1] > 2.0
    assert pooled.loc[5:].max() < 0.5


THREE_FEET = {
    "whole": ([], np.r_[90:150, 210:270, 390:450, 510:570]),
    "across two cycles": (["gait.touch_down=[0.1, 0.6, 0.9, 0.4]"], np.r_[0:30, 150:210, 270:330, 450:510, 570:600]),
    "cut short by a fall": (["posture.gain=0"], np.r_[90:147]),
}


@pytest.mark.parametrize("case", THREE_FEET)
def test_force_on_three_feet_is_measured_in_the_middle_half_of_their_planned_intervals(make_config, case):
    overrides, middle = THREE_FEET[case]
    rollout = roll_out(make_scenario(make_config("scenario=quadruped", "cycles=1", *overrides)))
    columns = rollout.columns()
    measured = compute(assemble(rollout.plan, columns, PERIOD), STEPS)["force_rmse_three_feet"]
    error = (columns["force"] - rollout.plan.force_desired[: len(rollout.samples)])[middle]
    assert_allclose(measured, np.sqrt((error**2).mean(axis=0)), rtol=1e-12)


# The paper's story (Fig. 17 to 20)


def test_rear_margin_is_shortest_as_foot_3_lifts_tied_with_foot_4(walk):
    rear = walk(*ALL_THREE).body.margin_rear[:STEPS].to_numpy()
    assert rear[LIFT_OFF[2]] == pytest.approx(rear.min(), abs=1e-12)
    assert rear[LIFT_OFF[3]] == pytest.approx(rear.min(), abs=1e-12)
    assert np.sort(rear)[2] > rear.min() + 1e-4


def test_as_foot_3_lifts_foot_2_is_to_carry_1_43_newtons(walk):
    assert walk(*ALL_THREE).trace["force_desired"][LIFT_OFF[2], 1] == pytest.approx(1.43, abs=0.005)


def test_the_force_of_foot_2_falls_to_1_to_2_newtons_within_60_ms(walk):
    run, within = walk(*ALL_THREE), slice(LIFT_OFF[2], LIFT_OFF[2] + 13)
    for cycle in range(10, 21):
        force = run.of_cycle("force", cycle)[within, 1]
        assert force[0] > 3.0
        assert 1.0 <= force.min() <= 2.0


def test_front_margin_is_shortest_late_in_the_transfer_of_foot_2_tied_with_foot_1(walk):
    run = walk(*ALL_THREE)
    front = run.body.margin_front[:STEPS].to_numpy()
    for leg in (1, 0):
        last = TOUCH_DOWN[leg] - 1
        assert front[last] == pytest.approx(front.min(), abs=1e-12)
        assert run.trace["phase"][last, leg] == "transfer"
        assert run.trace["progress"][last, leg] > 0.99
    assert np.sort(front)[2] > front.min() + 1e-4


def test_foot_1_unloads_late_early_in_learning_and_in_time_later(walk):
    run = walk(*ALL_THREE)
    late = [int(np.argmax(run.of_cycle("force", cycle)[LIFT_OFF[0] :, 0] == 0.0)) for cycle in range(1, 21)]
    assert late[1] * PERIOD >= 0.02
    assert max(late[4:]) * PERIOD <= 0.01


def test_with_the_literal_reference_the_body_leans(walk):
    run = walk(*LITERAL)
    tilt = run.body_metrics.tilt_max.loc[8:10]
    assert run.code == 0
    assert tilt.min() >= 80e-3
    assert tilt.max() <= 140e-3


# What a run leaves behind

BODY = {
    "step": "", "time": "s", "cycle": "", "height": "m", "pitch": "rad", "roll": "rad", "yaw": "rad",
    "cog_x": "m", "cog_y": "m",
    "stability_margin": "m", "margin_front": "m", "margin_rear": "m", "supporting_legs": "",
}  # fmt: skip
BODY_METRICS = {
    "cycle": None, "height_mean": "m", "height_min": "m", "height_max": "m", "tilt_max": "rad",
    "stability_margin_min": "m", "margin_front_min": "m", "margin_rear_min": "m",
}  # fmt: skip


@pytest.mark.parametrize(("file", "columns"), [("body", BODY), ("body_metrics", BODY_METRICS)])
def test_tables_of_the_body_have_the_columns_of_the_contract_with_unit_and_meaning(walk, file, columns):
    schema = pq.read_schema(walk(*ALL_THREE).folder / f"{file}.parquet")
    assert schema.names == list(columns)
    for name, unit in columns.items():
        if unit is not None:
            assert schema.field(name).metadata[b"unit"].decode() == unit
            assert schema.field(name).metadata[b"meaning"]


def test_files_of_a_walk(walk):
    assert set(walk(*ALL_THREE).manifest["files"]) == {
        "trace.parquet", "body.parquet", "memory.parquet", "metrics.parquet", "metrics.csv", "body_metrics.parquet",
    }  # fmt: skip


def test_a_walk_has_a_row_per_step_and_leg_and_a_row_of_the_body_per_step(walk):
    run = walk(*ALL_THREE)
    assert_array_equal(run.trace["step"], np.tile(np.arange(20 * STEPS)[:, None], 4))
    assert_array_equal(run.body.step, np.arange(20 * STEPS))
    assert_array_equal(run.body.cycle, np.arange(20 * STEPS) // STEPS + 1)
    assert_allclose(run.body.time, np.arange(20 * STEPS) * PERIOD, rtol=1e-15)
    assert run.metrics.index.tolist() == [(cycle, leg) for cycle in range(1, 21) for leg in (1, 2, 3, 4)]
    assert run.body_metrics.index.tolist() == list(range(1, 21))


def test_the_trace_transfers_where_the_gait_diagram_does(walk):
    transfer = walk(*ALL_THREE).of_cycle("phase", 3) == "transfer"
    for leg, (lift_off, touch_down) in enumerate(zip(LIFT_OFF, TOUCH_DOWN, strict=True)):
        assert_array_equal(np.flatnonzero(transfer[:, leg]), range(lift_off, touch_down or STEPS))


@pytest.mark.parametrize("command", WALKS, ids=" ".join)
def test_supporting_legs_are_the_bits_of_the_feet_that_press(walk, command):
    run = walk(*command)
    mask = sum((run.trace["force"][:, leg] > 0.0).astype(int) << leg for leg in range(4))
    assert_array_equal(run.body.supporting_legs, mask)


@pytest.mark.parametrize("gait", [(), ("gait.stroke=0.2", "gait.duty_factor=0.9", "gait.cycle_time=4")])
def test_the_centre_of_gravity_advances_by_a_stride_each_cycle(walk, gait):
    run = walk(*(("cycles=2", *gait) if gait else ALL_THREE))
    stride, cycle_time = (0.2 / 0.9, 4.0) if gait else (0.3 / 0.8, 3.0)
    assert_allclose(run.body.cog_x, run.body.time * stride / cycle_time, rtol=1e-12)
    assert not run.body.cog_y.any()


def test_body_metrics_are_ranges_and_minima_of_each_cycle(walk):
    run = walk(*ALL_THREE)
    cycles = run.body.groupby("cycle")
    expected = pd.DataFrame(
        {
            "height_mean": cycles.height.mean(),
            "height_min": cycles.height.min(),
            "height_max": cycles.height.max(),
            "tilt_max": cycles[["pitch", "roll"]].agg(lambda angle: angle.abs().max()).max(axis=1),
            **{f"{name}_min": cycles[name].min() for name in ("stability_margin", "margin_front", "margin_rear")},
        }
    )
    pd.testing.assert_frame_equal(run.body_metrics, expected, rtol=1e-14, check_index_type=False)


def test_score_gives_the_same_metrics_of_the_body_again(walk):
    folder = walk(*FALLING).folder
    before = (folder / "body_metrics.parquet").read_bytes()
    (folder / "body_metrics.parquet").unlink()
    assert python("-m", "cmacexp.score", str(folder), folder=folder).returncode == 0
    assert (folder / "body_metrics.parquet").read_bytes() == before


BAD = {
    "gait.duty_factor=0.7": "gait.duty_factor=0.7: must be at least 0.75",
    "gait.touch_down=[0,0,0.5,0.5]": "only 2 feet are down at t = 0.900 s",
    "gait.touch_down=[0,0.5,0.25,0.75]": "the stability margin is -0.0538 m at t = 0.150 s",
    "gait.stroke=0.5": "legs left_front and left_rear would cross at t = ",
    "gait.lift=0.55": "gait.lift=0.55: leg 1 cannot lift its foot to ",
    "machine.hip_height=0.75": "machine.hip_height=0.75: the foot of leg 1 would be",
    "force_control.desired_force=3": "the weight is shared out",
    "machine.legs.left_fron.mass_1=1": "did you mean machine.legs.left_front?",
}


@pytest.mark.parametrize("override", BAD)
def test_bad_input_is_one_line_before_anything_is_simulated(override, tmp_path):
    done = cmacexp("scenario=quadruped", override, folder=tmp_path)
    assert done.returncode == 2
    assert BAD[override] in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not done.stdout
    assert not list(tmp_path.rglob("*.parquet"))


# Two loops, one result

SPREAD = {
    "terrain": ["soft_flat", "patchy"],
    "feedforward": ["none", "cmac", "inverse_dynamics"],
    "reference": ["literal", "aware", "force_feedforward"],
    "machine.legs.right_rear.mass_1": [0.5, 0.8],
    "machine.legs.left_front.length_2": [0.35, 0.4],
    "gait.load_ramp": [0.0, 0.1],
    "gait.vertical": ["cubic", "two_cubics"],
    "posture.gain": [0.0, 8.0],
    "learning.lead": [0, 1],
    "plant.substeps": [1, 3],
    "actuator.torque_limit": ["null", 8.0],
}
CASES = random.Random(1997).sample(list(itertools.product(*SPREAD.values())), 16)


def same_bits(one, other):
    return one.shape == other.shape and one.tobytes() == other.tobytes()


def test_the_cases_take_in_every_value():
    assert [set(column) for column in zip(*CASES, strict=True)] == [set(values) for values in SPREAD.values()]


@pytest.mark.parametrize("case", CASES, ids=lambda case: "-".join(map(str, case)))
def test_fused_loop_equals_stepped_loop_to_the_bit(make_config, case):
    overrides = [f"{key}={value}" for key, value in zip(SPREAD, case, strict=True)]
    config = make_config("scenario=quadruped", *overrides, "cycles=2", "cmac.memory_bytes=65536")
    fused, stepped = roll_out(make_scenario(config)), roll_out(make_scenario(config), fused=False)
    assert (fused.status, fused.cause) == (stepped.status, stepped.cause)
    assert same_bits(fused.samples, stepped.samples)
    assert same_bits(fused.body_samples, stepped.body_samples)


ELSEWHERE = """
import sys
import numpy as np
from hydra import compose, initialize_config_dir
from cmacexp.config import config_folder, to_config
from cmacexp.loop import roll_out
from cmacexp.loop.scenario import make_scenario

with initialize_config_dir(str(config_folder()), version_base="1.3"):
    rollout = roll_out(make_scenario(to_config(compose("config", sys.argv[2:]))))
np.savez(sys.argv[1], samples=rollout.samples, body=rollout.body_samples, cause=rollout.cause)
"""


@pytest.mark.parametrize(
    "overrides",
    [
        ["cycles=2", "gait.cycle_time=1.5", "learning.lead=1", "machine.legs.left_front.mass_1=0.6"],
        ["cycles=1", "terrain=patchy", "gait.load_ramp=0.1", "learning.start_cycle=1", "plant.substeps=2"],
        ["cycles=1", "posture.gain=0"],
    ],
    ids=["learning", "patchy", "falling"],
)
def test_plain_python_gives_the_bits_of_compiled_code(make_config, tmp_path, overrides):
    command = [sys.executable, "-c", ELSEWHERE, str(tmp_path / "plain.npz"), "scenario=quadruped", *overrides]
    subprocess.run(command, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, check=True)
    compiled = roll_out(make_scenario(make_config("scenario=quadruped", *overrides)))
    with np.load(tmp_path / "plain.npz") as plain:
        assert same_bits(plain["samples"], compiled.samples)
        assert same_bits(plain["body"], compiled.body_samples)
        assert str(plain["cause"]) == compiled.cause


# Symmetry

MIRRORED = "gait.touch_down=[0.5, 0.0, 0.3, 0.8]"
OTHER_SIDE = [1, 0, 3, 2]
MIRROR = [1.0, 1.0, -1.0, 1.0, -1.0, -1.0]
"""Of the columns of a body."""


@pytest.mark.parametrize(
    "overrides",
    [
        ["feedforward=none", "cycles=5"],
        ["cycles=8"],
        ["cycles=4", "reference=literal"],
        ["cycles=4", "posture.gain=4"],
    ],
    ids=" ".join,
)
def test_a_mirrored_gait_gives_the_mirrored_walk(make_config, overrides):
    """Also of what the CMACs learn: all have the same hash, and joint angles do not know left from right."""
    walked, mirrored = (
        roll_out(make_scenario(make_config("scenario=quadruped", *overrides, *gait))) for gait in ([], [MIRRORED])
    )
    assert (walked.status, len(walked.samples)) == (mirrored.status, len(mirrored.samples))
    assert_allclose(mirrored.samples, walked.samples[:, OTHER_SIDE], atol=1e-9)
    assert_allclose(mirrored.body_samples, walked.body_samples * MIRROR, atol=1e-9)


def test_a_mirrored_machine_gives_the_mirrored_walk_too(make_config):
    one = ["machine.legs.left_front.mass_1=0.7", "machine.legs.left_rear.length_2=0.37"]
    other = [override.replace("left", "right") for override in one]
    walked, mirrored = (
        roll_out(make_scenario(make_config("scenario=quadruped", "cycles=3", *overrides)))
        for overrides in (one, [*other, MIRRORED])
    )
    assert_allclose(mirrored.samples, walked.samples[:, OTHER_SIDE], atol=1e-9)
    assert_allclose(mirrored.body_samples, walked.body_samples * MIRROR, atol=1e-9)


# Legs of their own


def legs_of(config):
    return dataclasses.asdict(config.machine)["legs"]


def test_the_mass_of_one_leg_changes_that_leg_alone(make_config):
    plain, changed = (
        make_config("scenario=quadruped", *overrides) for overrides in ([], ["machine.legs.left_front.mass_1=0.6"])
    )
    expected = legs_of(plain)
    expected["left_front"]["mass_1"] = 0.6
    assert legs_of(changed) == expected
    one, other = make_mechanism(plain.machine), make_mechanism(changed.machine)
    assert_array_equal(np.argwhere(one.legs != other.legs), [[0, 2]])
    assert_array_equal(one.hips, other.hips)


def test_what_is_set_for_all_legs_goes_to_all_of_them_but_those_with_their_own(make_config):
    legs = legs_of(make_config("scenario=quadruped", "machine.leg.mass_1=0.6", "machine.legs.right_rear.mass_1=0.7"))
    assert [leg["mass_1"] for leg in legs.values()] == [0.6, 0.6, 0.6, 0.7]
    assert [leg["mass_2"] for leg in legs.values()] == [0.5] * 4


def test_legs_of_their_own_have_their_own_hips_links_and_knees(make_config):
    own = ["length_1=0.3", "length_2=0.4", "hip_x=0.25", "hip_y=-0.2", "knee=back", "mass_2=0.4"]
    config = make_config("scenario=quadruped", *(f"machine.legs.right_front.{value}" for value in own))
    mechanism = make_mechanism(config.machine)
    assert_array_equal(mechanism.legs[1], [0.3, 0.4, 0.5, 0.4, -1.0])
    assert_array_equal(mechanism.hips[1], [0.25, -0.2])
    assert_array_equal(mechanism.legs[[0, 2, 3], 4], [1.0, -1.0, -1.0])


@pytest.mark.parametrize("override", ["length_1=0.4", "mass_1=0.8", "mass_2=0.3"])
def test_planned_joints_and_torques_of_the_other_legs_stay_as_they_are(make_config, override):
    plain, changed = (
        make_scenario(make_config("scenario=quadruped", "feedforward=inverse_dynamics", *overrides))
        for overrides in ([], [f"machine.legs.left_front.{override}"])
    )
    differs = [
        (one != other).any(axis=(0, 2)).tolist()
        for one, other in (
            (plain.setup.plan.joints, changed.setup.plan.joints),
            (plain.feedforward.params.torque, changed.feedforward.params.torque),
        )
    ]
    assert differs == [[override.startswith("length"), False, False, False], [True, False, False, False]]
    assert_array_equal(plain.setup.plan.force_desired, changed.setup.plan.force_desired)


# Ground in patches


def test_patches_change_the_walk_and_their_seed_too(make_config):
    walks = [
        roll_out(make_scenario(make_config("scenario=quadruped", "cycles=1", "feedforward=none", *overrides)))
        for overrides in ([], ["terrain=patchy"], ["terrain=patchy", "terrain.patch_seed=1"])
    ]
    for one, other in itertools.combinations(walks, 2):
        assert (one.body_samples != other.body_samples).any()


def test_patchy_ground_without_spread_is_flat_to_the_bit(make_config):
    flat, patchy = (
        roll_out(make_scenario(make_config("scenario=quadruped", "cycles=1", *overrides)))
        for overrides in ([], ["terrain=patchy", "terrain.patch_spread=0", "terrain.patch_seed=3"])
    )
    assert same_bits(flat.samples, patchy.samples)


def test_it_walks_over_patches(walk):
    run = walk(*PATCHY)
    assert run.code == 0
    assert not np.allclose(run.body.height, walk(*ALL_THREE).body.height[: len(run.body)], atol=1e-5)


def test_the_ground_of_a_scenario_is_that_of_its_config(make_config):
    scenario = make_scenario(make_config("scenario=quadruped", "terrain=patchy", "terrain.patch_seed=9"))
    assert scenario.plant.params.ground == still_ground(1e4, 0.15, 0.5, 9)


# Falls

AT_REST = np.zeros((4, 2))


@pytest.fixture
def guard(make_config):
    """A guard whose planned margin is negative in the first hundred samples."""
    mechanism = make_mechanism(make_config("scenario=quadruped").machine)
    return new_guard(mechanism, np.r_[np.full(100, -1e-3), np.full(400, 0.02), np.full(100, np.nan)], PERIOD)


def stop_at(guard, body, sample=300, q=AT_REST, dq=AT_REST, force=None):
    """Why a machine stops in this state, and in words."""
    body = np.array(body, dtype=float)
    force = np.full(4, 10.0) if force is None else np.asarray(force)
    status = stop_reason(guard, sample, q, dq, np.zeros((4, 2)), force, body)
    return status, describe_stop(guard, status, 200, PERIOD, q, dq, body) if status != RUNNING else ""


FALLS = {
    "no height, pitch and roll balance the body": (np.nan, 0.0, 0.0),
    "pitch 0.510 rad, beyond 0.5 rad": (0.5, 0.51, 0.0),
    "pitch -0.510 rad, beyond 0.5 rad": (0.5, -0.51, 0.3),
    "roll 0.510 rad, beyond 0.5 rad": (0.5, 0.3, 0.51),
    "roll -0.510 rad, beyond 0.5 rad": (0.5, 0.0, -0.51),
    "hip of leg 1 at 0.240 m, below 0.25 m": (0.24, 0.0, 0.0),
    "hip of leg 2 at 0.246 m, below 0.25 m": (0.3, 0.1, 0.14),  # down in front and on the right
    "hip of leg 3 at 0.222 m, below 0.25 m": (0.3, -0.2, -0.15),
}


@pytest.mark.parametrize("cause", FALLS)
def test_a_fall_is_named_with_step_time_and_cause(guard, cause):
    assert stop_at(guard, FALLS[cause]) == (FELL, f"at step 200 (t = 1.000 s): {cause}")


@pytest.mark.parametrize(
    "body",
    [(0.5, STEEPEST, 0.0), (0.5, 0.0, -STEEPEST), (LOWEST_HIP, 0.0, 0.0), (0.55, 0.3, -0.3)],
)
def test_up_to_its_limits_a_body_has_not_fallen(guard, body):
    assert stop_at(guard, body) == (RUNNING, "")


def test_a_negative_margin_is_a_fall_when_it_lasts_longer_than_a_quarter_of_a_second(guard):
    longest = round(LONGEST_TUMBLE / PERIOD)
    reasons = [stop_at(guard, (0.5, 0.0, 0.0), sample=k) for k in range(longest + 1)]
    assert reasons[:-1] == [(RUNNING, "")] * longest
    assert reasons[-1] == (FELL, "at step 200 (t = 1.000 s): stability margin negative for more than 0.25 s")


def test_a_margin_that_is_positive_or_undefined_in_between_starts_the_time_anew(guard):
    for recovered in (300, 550):
        for k in range(49):
            assert stop_at(guard, (0.5, 0.0, 0.0), sample=k)[0] == RUNNING
        assert stop_at(guard, (0.5, 0.0, 0.0), sample=recovered)[0] == RUNNING
    for k in range(50):
        assert stop_at(guard, (0.5, 0.0, 0.0), sample=k)[0] == RUNNING


def test_a_joint_too_fast_has_diverged_even_if_the_body_falls_as_well(guard):
    dq = AT_REST.copy()
    dq[2, 1] = -150.0
    status, cause = stop_at(guard, (0.1, 0.0, 0.0), dq=dq)
    assert status == DIVERGED
    assert cause.endswith("joint 2 of leg 3 moves at 150 rad/s, above 100 rad/s")


def test_a_machine_that_finds_no_balance_at_its_start_has_fallen(make_config):
    """On ground much softer than assumed: nothing is left to diverge, and no row holds what is not finite."""
    config = make_config("scenario=quadruped", "terrain.stiffness=50", "terrain.assumed_stiffness=1e4", "cycles=1")
    for fused in (True, False):
        rollout = roll_out(make_scenario(config), fused=fused)
        assert rollout.status == "fell"
        assert rollout.cause.endswith("no height, pitch and roll balance the body")
        assert np.isfinite(rollout.samples).all()


@pytest.mark.parametrize("stiffness", ["1e5", "1e6"])
def test_it_stands_on_stiff_ground(make_config, stiffness):
    config = make_config("scenario=quadruped", f"terrain.stiffness={stiffness}", "cycles=1", "feedforward=none")
    assert roll_out(make_scenario(config)).status == "completed"


def test_an_unstable_gait_that_is_allowed_runs_until_it_falls(make_config):
    config = make_config("scenario=quadruped", "gait.duty_factor=0.5", "gait.allow_unstable=true", "cycles=2")
    rollout = roll_out(make_scenario(config))
    assert rollout.status == "fell"
    assert len(rollout.samples) > 0
    assert np.isfinite(rollout.samples).all()
