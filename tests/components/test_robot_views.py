"""Robots as recordings and reports show them."""

import draw_walk as animation
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from support.made_traces import PERIOD
from support.robots import OWN
from support.views import FOOT_RADIUS, ROBOT_HIPS, make_robot, make_robot_traces, make_walk

import cmacexp
from cmacexp.data.manifest_fields import RUN_FIELDS, find_misfit
from cmacexp.models.chain import chain_points
from cmacexp.recording.events import find_events
from cmacexp.recording.run_view import make_view
from cmacexp.recording.scene import find_trunk, turn_from_up
from cmacexp.recording.series import collect_series
from cmacexp.report.run_report import make_run_report
from pipelines.common_machine import joints


@pytest.fixture(scope="module")
def robot():
    return make_robot()


@given(arrays(float, (5, 3), elements=st.floats(-1.0, 1.0).map(lambda value: round(value, 3))))
def test_a_turn_from_up_ends_in_the_direction(along):
    along = along[np.linalg.norm(along, axis=1) > 0.0]
    angles, axes = turn_from_up(along)
    assert_allclose(np.linalg.norm(axes, axis=1), 1.0)
    up = np.array([0.0, 0.0, 1.0])  # an axis is level: Rodrigues without its part along the axis
    turned = up * np.cos(angles)[:, None] + np.cross(axes, up) * np.sin(angles)[:, None]
    assert_allclose(turned, along / np.linalg.norm(along, axis=1)[:, None], atol=1e-12)


def test_the_joints_end_at_the_foot_of_the_trace(robot):
    for leg in robot.legs:
        *hinges, foot = leg.joints()
        assert len(hinges) == 3
        assert_allclose(foot, leg.foot(), atol=1e-12)


def test_hinges_keep_the_lengths_of_their_links(robot):
    for leg in robot.legs:
        lengths = np.linalg.norm(np.diff(leg.joints(), axis=0), axis=2)
        assert_allclose(lengths, np.tile([[0.08], [0.2], [0.2]], len(robot.time)), atol=1e-12)


def test_left_and_right_mirror_each_other(robot):
    for left, right in ((0, 1), (2, 3)):
        sides = [np.array(robot.legs[leg].joints())[:, 0] for leg in (left, right)]
        assert_allclose(sides[0] * [1.0, -1.0, 1.0], sides[1], atol=1e-12)


def test_the_ground_that_is_seen_touches_a_standing_foot_from_below(robot):
    feet = np.stack([robot.in_world(leg.foot()) for leg in robot.legs], axis=1)
    standing = feet[np.stack([leg.support for leg in robot.legs], axis=1)]
    assert_allclose(standing[:, 2] - robot.surface(standing[:, 0]), FOOT_RADIUS, atol=1e-12)
    assert make_walk().surface(np.zeros(1)) == 0.0


def test_the_trunk_spans_the_first_hinges(robot):
    middle, half = find_trunk(robot)
    assert middle == pytest.approx([0.0, 0.0, 0.0])
    assert half[:2] == pytest.approx([ROBOT_HIPS[0][0], ROBOT_HIPS[0][1] - 0.08])


def test_series_have_every_axis_and_joint_and_feedback_without_what_the_plan_knows(robot):
    lines = collect_series(robot)
    assert [values[0] for _, values, _ in lines["leg_1/error"]] == pytest.approx([-1.0, -2.0, -3.0])
    for joint in (1, 2, 3):
        known, feedback, _ = (values[0] for _, values, _ in lines[f"leg_4/torque_{joint}"])
        assert (known, feedback) == (2.0 * joint, 1.0 * joint)


def test_moments_of_a_robot_are_none_of_the_paper(robot):
    texts = [event.text for event in find_events(robot)]
    assert sum("touches down" in text for text in texts) == 4
    assert not any("Fig." in text for text in texts)


def test_side_and_animation_draw_all_joints(robot, tmp_path, monkeypatch):
    assert joints(robot).shape == (len(robot.time), 4, 4, 3)
    monkeypatch.setattr(animation, "FRAMES_PER_SECOND", 1.0 / PERIOD / len(robot.time))
    assert animation.write_animation([robot], tmp_path / "robot.gif") == 2


def test_without_its_geometry_a_robot_is_no_manifest_of_one():
    traces, manifest = make_robot_traces()
    robot, shape = manifest["robot"], RUN_FIELDS["robot?"]
    assert find_misfit(robot, shape, "robot") is None
    for name in robot:
        assert find_misfit({key: value for key, value in robot.items() if key != name}, shape, "robot")
        assert find_misfit({**robot, name: "other"}, shape, "robot")
    assert make_view(traces, manifest).is_robot


def test_a_run_of_a_robot_is_recorded_and_reported(tmp_path):
    pytest.importorskip("mujoco")
    own = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}", "feedforward=none", "cycles=1")
    run = cmacexp.run(
        [*own, "gait.cycle_time=0.4", "gait.stroke=0.02", "gait.lift=0.01", "gait.allow_unstable=true", "warn=false"],
        tmp_path / "run",
    )
    assert run.status == "completed"
    assert (run.folder / "recording.rrd").stat().st_size > 1000
    feet = run.trace[["x", "y", "z"]].to_numpy().reshape(-1, 4, 3)
    chains, q = run.manifest["robot"]["chains"], run.trace[["q1", "q2", "q3"]].to_numpy().reshape(-1, 4, 3)
    assert_allclose(feet, find_feet(chains, q), atol=1e-9)
    sections = {section.title: section.parts for section in make_run_report(run).sections}
    errors = [part.name for part in sections["Over a cycle"]]
    assert errors == ["foot", "force", "error_x", "error_y", "error_z"]
    (torques,) = [part for part in sections["Feedback and feedforward"] if getattr(part, "name", "") == "torques"]
    assert len(torques.figure.axes) == 12


def find_feet(chains, q):
    """Feet (steps, 4, 3) in the frames of their hips."""
    return np.stack([chain_points(np.array(chain), q[:, leg])[:, 3] for leg, chain in enumerate(chains)], axis=1)
