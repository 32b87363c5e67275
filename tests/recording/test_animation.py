"""The moving picture of a run, as ``docs/recordings.md`` makes it."""

import draw_walk
import numpy as np
import pytest
from PIL import Image
from support.views import make_walk

pytestmark = pytest.mark.ci


def test_a_picture_plays_for_the_time_of_one_cycle_and_again(tmp_path, monkeypatch):
    monkeypatch.setattr(draw_walk, "FRAMES_PER_SECOND", 1.0)
    path = tmp_path / "walk.gif"
    assert draw_walk.write_animation([make_walk(1, 0.05), make_walk(10)], path) == 2
    with Image.open(path) as picture:
        assert (picture.n_frames, picture.info["loop"], picture.info["duration"]) == (2, 0, 1000)
        frames = [np.asarray(picture.convert("RGB")) for number in range(2) if not picture.seek(number)]
    assert (frames[0] != frames[1]).any()


def test_the_command_draws_the_first_and_the_last_cycle_of_a_run(stored, tmp_path, monkeypatch):
    monkeypatch.setattr(draw_walk, "FRAMES_PER_SECOND", 0.4)
    run = stored("scenario=one_leg", "cycles=3", "record.weights=true")
    monkeypatch.setattr("sys.argv", ["draw_walk", str(run.folder), "--out", str(tmp_path / "leg.gif")])
    assert draw_walk.main() == 0
    with Image.open(tmp_path / "leg.gif") as picture:
        assert picture.n_frames > 0
