"""Machines as recordings and reports show them: in the world, and robots as their models."""

import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.command import call
from support.doors import read_shown_model
from support.recordings import read_rows
from support.robots import OWN, ROBOT, SHORT
from support.views import FOOT_RADIUS, make_robot, make_walk


def test_a_leg_in_a_plane_hangs_from_the_body_and_tilts_with_it():
    view = make_walk()
    assert_allclose(
        view.in_world(view.joints)[0, 1], [[0.2, -0.1, 0.5], [0.2, -0.1, 0.25], [0.2, -0.1, 0.0]], atol=1e-12
    )
    assert_allclose(view.in_world(view.feet())[7, 1], [0.2, -0.1, 0.1], atol=1e-12)
    view.body["pitch"] = np.full(len(view.time), 0.1)
    front, rear = view.in_world(view.joints)[0, [0, 2], 0, 2]
    assert front - rear == pytest.approx(-0.4 * np.sin(0.1))


def test_the_joints_of_a_robot_end_at_the_foot_of_the_trace_keep_the_lengths_of_links_and_mirror_each_other():
    robot = make_robot()
    joints = robot.joints  # (steps, legs, joints, 3)
    assert_allclose(joints[:, :, 3], robot.feet(), atol=1e-12)
    lengths = np.linalg.norm(np.diff(joints, axis=2), axis=3)
    assert_allclose(lengths - np.array([0.08, 0.2, 0.2]), 0.0, atol=1e-12)
    assert_allclose(joints[0, [0, 2]] * [1.0, -1.0, 1.0], joints[0, [1, 3]], atol=1e-12)
    feet = robot.in_world(robot.feet())[robot.trace.support]
    assert_allclose(feet[:, 2] - robot.surface(feet[:, 0]), FOOT_RADIUS, atol=1e-12)


@pytest.fixture(scope="module")
def run(stored):
    return stored(*ROBOT, f"machine.path={OWN}", *SHORT)


@pytest.mark.ci
def test_a_robot_is_drawn_as_its_model_shows_it(run, tmp_path):
    folder, root = shutil.copytree(run.folder, tmp_path / "run"), "/world/travel/body/robot/"
    done = call("replay", folder, "--no-viewer", "--meshes")
    assert done.returncode == 0, done.stderr
    found, step = {}, 50
    for path, row in read_rows(folder / "recording.rrd", f"{root}**"):
        if row.get("step", 0) <= step:
            found.setdefault(path.removeprefix(root), {}).update(row)  # what holds in the step
    links = [f"{leg}_{part}" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh", "calf")]
    assert {path for path in found if "/" not in path} == {"trunk", *links}
    at, turn = ({p: np.array(found[p][f"Transform3D:{n}"][0]) for p in found} for n in ("translation", "quaternion"))
    trace, robot = run.trace[run.trace.step == step], read_shown_model(run)
    data = robot.at(trace[["q1", "q2", "q3"]].to_numpy())
    for name in links:
        assert_allclose(at[name] - at["trunk"], data.body(name).xpos, atol=1e-3)
        assert_allclose(turn[name], np.roll(data.body(name).xquat, -1), atol=1e-3)
    feet = trace[["x", "z", "y"]].to_numpy() * [1, 1, -1] + np.pad(run.manifest["robot"]["hips"], ((0, 0), (0, 1)))
    assert_allclose(at["trunk"] + data.geom_xpos[robot.legs.foot_geom], feet, atol=1e-3)
