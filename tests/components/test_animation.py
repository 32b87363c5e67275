"""The moving picture of a run."""

import numpy as np
import pytest
from PIL import Image
from support.views import make_walk

import cmacexp
from cmacexp.commands.report import main
from cmacexp.data.folder import locked
from cmacexp.report import animation
from cmacexp.report.machine import joints

RUN = ("cycles=3", "gait.cycle_time=1.5", "record=trace")


def test_joints_are_hip_knee_and_foot_in_mm():
    places = joints(make_walk())
    hip, knee, foot = places[0, 1]
    assert hip == pytest.approx([200.0, -100.0, 500.0])
    assert knee == pytest.approx([200.0, -100.0, 250.0])
    assert foot == pytest.approx([200.0, -100.0, 0.0])
    assert places[7, 1, 2, 2] == pytest.approx(100.0)


def test_the_body_tilts_the_joints_with_it():
    view = make_walk()
    view.body["pitch"] = np.full(len(view.time), 0.1)
    front, rear = joints(view)[0, [0, 2], 0, 2]
    assert front - rear == pytest.approx(-400.0 * np.sin(0.1))


def test_a_picture_plays_for_the_time_of_one_cycle_and_again(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "FRAMES_PER_SECOND", 1.0)
    path = tmp_path / "walk.gif"
    assert animation.write_animation([make_walk(1, 0.05), make_walk(10)], path) == 2
    with Image.open(path) as picture:
        assert picture.n_frames == 2
        assert picture.width == 800
        assert picture.info["loop"] == 0
        assert picture.info["duration"] == 1000
        frames = []
        for number in range(2):
            picture.seek(number)
            frames.append(np.asarray(picture.convert("RGB")).copy())
    assert (frames[0] != frames[1]).any()


def test_the_command_leaves_it_beside_the_page(tmp_path, monkeypatch):
    """``docs/recordings.md``, of one leg and in fewer frames."""
    monkeypatch.setattr(animation, "FRAMES_PER_SECOND", 0.5)
    run = cmacexp.run(RUN, tmp_path / "run")
    monkeypatch.setattr("sys.argv", ["report", str(run.folder), "--gif", "--cycles", "1,3"])
    assert main() == 0
    with Image.open(tmp_path / "run" / "report" / "animation.gif") as picture:
        assert picture.n_frames == 2


def animate(monkeypatch, folder, out):
    monkeypatch.setattr("sys.argv", ["report", str(folder), "--gif", "--out", str(out)])
    return main()


@pytest.fixture
def stored(tmp_path):
    return cmacexp.run(RUN, tmp_path / "run").folder


def test_a_picture_is_not_put_into_a_folder_in_use(monkeypatch, stored, tmp_path, capsys):
    with locked(tmp_path / "out", "key"):
        assert animate(monkeypatch, stored, tmp_path / "out") == 2
    assert "writes here; wait until it has ended" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.gif"))
