"""The moving picture of a run."""

import draw_walk as animation
import numpy as np
import pytest
from PIL import Image
from support.views import make_walk

import cmacexp
from pipelines.common_machine import joints

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


def test_the_command_draws_the_first_and_the_last_cycle_of_a_run(tmp_path, monkeypatch):
    """``python -m docs.draw_walk`` as in ``docs/recordings.md``, of one leg and in fewer frames."""
    monkeypatch.setattr(animation, "FRAMES_PER_SECOND", 0.5)
    run = cmacexp.run(RUN, tmp_path / "run")
    monkeypatch.setattr("sys.argv", ["draw_walk", str(run.folder), "--out", str(tmp_path / "leg.gif")])
    assert animation.main() == 0
    with Image.open(tmp_path / "leg.gif") as picture:
        assert picture.n_frames == 2
