"""Meshes of a robot in its recording: what is seen of each body, where it is, and what is refused."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rerun.chunk import RrdReader
from support.command import python
from support.robots import OWN

import cmacexp
from cmacexp.errors import BadInput
from cmacexp.recording.meshes import read_shown_model

mujoco = pytest.importorskip("mujoco")
CORNERS = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.03], [0.0, 0.06, 0.0], [0.1, 0.0, 0.0]])
STEP = 150


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A walk of the project's own model with a wedge on its trunk."""
    path, load = tmp_path_factory.mktemp("model") / "wedge.xml", '<geom type="box" size="0.04'
    asset = f'<asset><mesh name="wedge" vertex="{" ".join(map(str, CORNERS.ravel()))}"/></asset></mujoco>'
    text = OWN.read_text().replace(load, f'<geom type="mesh" mesh="wedge" pos="0 0 0.06"/>{load}')
    path.write_text(text.replace("</mujoco>", asset))
    own = ["scenario=robot", "machine=mjcf", f"machine.path={path}", "feedforward=none", "cycles=1", "warn=false"]
    own += ["gait.cycle_time=0.4", "gait.stroke=0.02", "gait.lift=0.01", "gait.allow_unstable=true"]
    return cmacexp.run(own, tmp_path_factory.mktemp("runs") / "run")


def turned(quaternion, points):
    mujoco.mju_quat2Mat(matrix := np.empty(9), np.roll(quaternion, 1) / np.linalg.norm(quaternion))
    return points @ matrix.reshape(3, 3).T


def test_a_robot_is_drawn_as_its_model_shows_it(run):
    replay, root = ("-m", "cmacexp.replay", "--no-viewer", "."), "/world/travel/body/robot/"
    built = python(*replay, "--meshes", folder=run.folder).stdout
    assert built.endswith("every step, with meshes; it replaces the one that was there\n")
    assert "as it was built" in python(*replay, folder=run.folder).stdout
    found = {}
    for chunk in RrdReader(run.folder / "recording.rrd").stream().filter(content=f"{root}**").to_chunks():
        for row in (row for row in chunk.to_record_batch().to_pylist() if row.get("step", 0) <= STEP):
            found.setdefault(chunk.entity_path.removeprefix(root), {}).update(row)  # what holds in the step
    links = [f"{leg}_{part}" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh", "calf")]
    assert {path for path in found if "/" not in path} == {"trunk", *links}
    assert len(found) == 13 + 3 + 12  # bodies, geoms of the trunk, one geom of each link: no foot
    at, turn = ({p: np.array(found[p][f"Transform3D:{n}"][0]) for p in found} for n in ("translation", "quaternion"))
    (mesh,) = [path for path, columns in found.items() if "Mesh3D:vertex_positions" in columns]
    drawn = turned(turn[mesh], np.array(found[mesh]["Mesh3D:vertex_positions"])) + at[mesh]
    assert_allclose(drawn[np.lexsort(np.round(drawn.T[::-1], 2))], np.add(CORNERS, [0.0, 0.0, 0.06]), atol=1e-3)
    trace, robot = run.trace[run.trace.step == STEP], read_shown_model(run.folder, run.manifest)
    data = robot.at(trace[["q1", "q2", "q3"]].to_numpy())
    for name in links:
        assert_allclose(at[name] - at["trunk"], data.body(name).xpos, atol=1e-3)
        assert_allclose(turn[name], np.roll(data.body(name).xquat, -1), atol=1e-3)
    for calf, foot, (x, y), row in zip(
        links[2::3], robot.legs.foot_geom, run.manifest["robot"]["hips"], trace.itertuples(), strict=True
    ):  # of the body's frame, not the trunk's
        place = at[calf] + turned(turn[calf], robot.model.geom_pos[foot])
        assert_allclose(place, [row.x + x, row.z + y, -row.y], atol=2e-3)


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
