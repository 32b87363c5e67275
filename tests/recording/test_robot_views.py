"""Robots as recordings and reports show them."""

import sys

import draw_walk as animation
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from rerun.chunk import RrdReader
from support.command import python
from support.made_traces import PERIOD
from support.robots import OWN
from support.views import FOOT_RADIUS, ROBOT_HIPS, make_robot, make_robot_traces, make_walk

import cmacexp
from cmacexp.data.manifest_fields import RUN_FIELDS, find_misfit
from cmacexp.errors import BadInput
from cmacexp.models.chain import chain_points
from cmacexp.recording.events import find_events
from cmacexp.recording.meshes import read_shown_model
from cmacexp.recording.run_view import make_view
from cmacexp.recording.scene import find_trunk, turn_from_up
from cmacexp.recording.series import collect_series
from cmacexp.report.run_report import make_run_report
from pipelines.common_machine import joints

WEDGE = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.03], [0.0, 0.06, 0.0], [0.1, 0.0, 0.0]])
"""Corners, m."""


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


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A walk of the project's own model with a wedge, which is a mesh, on its trunk."""
    pytest.importorskip("mujoco")
    path, load = tmp_path_factory.mktemp("model") / "wedge.xml", '<geom type="box" size="0.04'
    asset = f'<asset><mesh name="wedge" vertex="{" ".join(map(str, WEDGE.ravel()))}"/></asset></mujoco>'
    text = OWN.read_text().replace(load, f'<geom type="mesh" mesh="wedge" pos="0 0 0.06"/>{load}')
    path.write_text(text.replace("</mujoco>", asset))
    own = ["scenario=robot", "machine=mjcf", f"machine.path={path}", "feedforward=none", "cycles=1", "warn=false"]
    own += ["gait.cycle_time=0.4", "gait.stroke=0.02", "gait.lift=0.01", "gait.allow_unstable=true"]
    return cmacexp.run(own, tmp_path_factory.mktemp("runs") / "run")


def test_a_run_of_a_robot_is_recorded_and_reported(run):
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


def turned(turn, points):
    """Points (n, 3) turned by a quaternion x y z w of about length 1."""
    along = 2.0 * np.cross(turn[:3], points)
    return points + turn[3] * along + np.cross(turn[:3], along)


def test_a_robot_is_drawn_as_its_model_shows_it(run):
    replay, root = ("-m", "cmacexp.replay", "--no-viewer", "."), "/world/travel/body/robot/"
    assert "with meshes; it replaces the one that was" in python(*replay, "--meshes", folder=run.folder).stdout
    assert "as it was built" in python(*replay, folder=run.folder).stdout
    found = {}
    for chunk in RrdReader(run.folder / "recording.rrd").stream().filter(content=f"{root}**").to_chunks():
        for row in (row for row in chunk.to_record_batch().to_pylist() if row.get("step", 0) <= 150):
            found.setdefault(chunk.entity_path.removeprefix(root), {}).update(row)  # what holds in the step
    links = [f"{leg}_{part}" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh", "calf")]
    assert {path for path in found if "/" not in path} == {"trunk", *links}
    assert len(found) == 13 + 3 + 12  # bodies, geoms of the trunk, one geom of each link: no foot
    at, turn = ({p: np.array(found[p][f"Transform3D:{n}"][0]) for p in found} for n in ("translation", "quaternion"))
    (mesh,) = [path for path, columns in found.items() if "Mesh3D:vertex_positions" in columns]
    drawn = turned(turn[mesh], np.array(found[mesh]["Mesh3D:vertex_positions"])) + at[mesh]
    assert_allclose(drawn[np.lexsort(np.round(drawn.T[::-1], 2))], np.add(WEDGE, [0.0, 0.0, 0.06]), atol=1e-3)
    trace, robot = run.trace[run.trace.step == 150], read_shown_model(run.folder, run.manifest)
    data = robot.at(trace[["q1", "q2", "q3"]].to_numpy())
    for name in links:
        assert_allclose(at[name] - at["trunk"], data.body(name).xpos, atol=1e-3)
        assert_allclose(turn[name], np.roll(data.body(name).xquat, -1), atol=1e-3)
    feet = trace[["x", "z", "y"]].to_numpy() * [1, 1, -1] + np.pad(run.manifest["robot"]["hips"], ((0, 0), (0, 1)))
    assert_allclose(at["trunk"] + data.geom_xpos[robot.legs.foot_geom], feet, atol=1e-3)


def test_what_is_no_model_of_the_run_is_refused_in_one_line(run, tmp_path, monkeypatch):
    def refuse(said, folder=tmp_path, **changed):
        machine = {**run.config["machine"], **changed}
        with pytest.raises(BadInput, match=said):  # whose text is one line
            read_shown_model(folder, {**run.manifest, "config": {**run.config, "machine": machine}})

    refuse("--meshes=.* is no run of a robot", kind="quadruped")
    refuse("ran with another model than .*robot.xml", path=str(OWN))
    refuse("no such file", path=str(tmp_path / "lost.xml"))
    refuse("lies in the folder of the run", folder=OWN.parent, path=str(OWN))
    refuse("machine.home=up: must be", home="up")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    (tmp_path / "new.xml").write_text(OWN.read_text())
    refuse("MuJoCo is not installed", folder=run.folder, path=str(tmp_path / "new.xml"))
