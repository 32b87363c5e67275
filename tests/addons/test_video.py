"""The moving picture of a run."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from support.command import ROOT, call, python
from support.views import make_walk

from cmacexp.addons.video import picture as video

pytestmark = pytest.mark.ci


@pytest.mark.parametrize("name", ["walk.gif", "walk.webp"])
def test_a_picture_plays_for_the_time_of_one_cycle_and_again(name, tmp_path, monkeypatch):
    monkeypatch.setattr(video, "FRAMES_PER_SECOND", 1.0)
    path = tmp_path / name
    assert video.write_video([make_walk(1, 0.05), make_walk(10)], path) == 2
    with Image.open(path) as picture:
        picture.load()
        assert (picture.n_frames, picture.info["loop"], picture.info["duration"]) == (2, 0, 1000)
        frames = [np.asarray(picture.convert("RGB")) for number in range(2) if not picture.seek(number)]
    assert (frames[0] != frames[1]).any()


def test_the_command_draws_the_first_and_the_last_cycle_of_a_run(leg, tmp_path, monkeypatch):
    monkeypatch.setattr(video, "FRAMES_PER_SECOND", 0.4)
    assert call("video", leg.folder, "--out", tmp_path / "leg.gif").returncode == 0
    with Image.open(tmp_path / "leg.gif") as picture:
        assert picture.n_frames > 0


RENDER = """
import numpy as np
from cmacexp.addons.video.picture import RobotPicture
from support.robots import read
robot = read()
picture = RobotPicture(robot)
for x in (0.0, 0.1):
    seen = picture.draw(robot.home, np.array([x, 0.0, 0.3]), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 1.2)
    print(*np.flatnonzero(seen[..., 3].any(axis=0))[[0, -1]])
"""


def test_a_robot_is_rendered_where_it_is(tmp_path):
    """In a process of its own: MuJoCo chooses how it draws when it is imported."""
    done = python("-c", RENDER, folder=tmp_path, PYTHONPATH=f"{ROOT}:{ROOT / 'tests'}", MUJOCO_GL="egl")
    if done.returncode and re.search("EGL|OpenGL", done.stderr):
        # The command then draws lines, which other tests look at; this one is of MuJoCo's picture alone.
        pytest.skip("no OpenGL without a screen on this machine, and MuJoCo renders with nothing else")
    assert done.returncode == 0, done.stderr
    edges = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert edges[0, 1] - edges[0, 0] > 40
    assert_allclose(edges[1] - edges[0], video.PIXELS * 0.1 / 1.2, atol=1.0)
