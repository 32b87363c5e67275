"""``python -m cmacexp.replay``: which recordings are built, kept and refused, and the viewer."""

import shutil
import signal
import socket
from contextlib import ExitStack
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np
import pytest
from support.command import call, started
from support.recordings import entities, lines

import cmacexp

RECORDING = "recording.rrd"


@pytest.fixture(scope="module")
def runs(stored, leg, walk, tmp_path_factory):
    """A folder with runs: leg, none, walk."""
    folder = tmp_path_factory.mktemp("runs")
    none = stored("scenario=one_leg", "cycles=2", "controller.velocity_gain=80")
    for name, run in {"leg": leg, "none": none, "walk": walk}.items():
        shutil.copytree(run.folder, folder / name)
    return folder


@pytest.fixture
def copy(runs, tmp_path):
    """A run that a test may change."""
    return shutil.copytree(runs / "leg", tmp_path / "leg")


def replay(*words, folder=None):
    return call("replay", "--no-viewer", *words, folder=folder)


def forces_of(folder):
    trace = cmacexp.load(folder).trace
    return trace[trace.leg == 1][["force_desired", "force"]].to_numpy(np.float32)


def test_a_window_of_cycles_is_shown_thinned_and_the_run_stays_intact(copy):
    assert replay(copy, "--cycles", "2-3", "--every", 7).returncode == 0
    steps, force = lines(copy / RECORDING, "leg_1/force")
    assert steps.tolist() == list(range(600, 1800, 7))
    assert (force == forces_of(copy)[600:1800:7]).all()
    assert call("verify", copy).returncode == 0


def test_a_recording_that_is_there_is_kept_until_another_is_asked_for(copy, tmp_path):
    before = (copy / RECORDING).read_bytes()
    for words in ((), ("--cycles", "1", "--out", tmp_path / "apart" / "first.rrd")):
        assert replay(copy, *words).returncode == 0
        assert (copy / RECORDING).read_bytes() == before
    assert len(lines(tmp_path / "apart" / "first.rrd", "leg_1/force")[0]) == 600
    replay(copy, "--cycles", "last")
    assert lines(copy / RECORDING, "leg_1/force")[0][0] == 1200
    replay(copy, "--rebuild")
    assert lines(copy / RECORDING, "leg_1/force")[0][0] == 0


def test_a_recording_that_is_missing_damaged_a_link_or_of_another_run_is_built_anew(copy, runs, tmp_path):
    path, other = copy / RECORDING, tmp_path / "other.rrd"
    shutil.copy(runs / "none" / RECORDING, other)
    for spoil in (lambda: path.write_text("mine"), lambda: shutil.copy(other, path), lambda: path.symlink_to(other)):
        path.unlink()
        spoil()
        assert (replay(copy).returncode, path.is_symlink()) == (0, False)
        assert len(lines(path, "leg_1/force")[0]) == 1800
    assert other.read_bytes() == (runs / "none" / RECORDING).read_bytes()


def test_runs_side_by_side_show_the_cycles_that_all_took_and_stay_as_they_are(runs, tmp_path):
    before = {path: path.read_bytes() for path in runs.rglob("*") if path.is_file()}
    done = replay(runs / "leg", runs / "walk", "--cycles", "last", folder=tmp_path)
    (path,) = tmp_path.rglob("*.rrd")
    assert (done.returncode, path.name) == (0, "leg-walk.rrd"), done.stderr
    roots = sorted({entity.split("/")[1] for entity in entities(path) if entity[1:2].isdecimal()})
    assert [root[:2] for root in roots] == ["1_", "2_"]
    for root, name in zip(roots, ("leg", "walk"), strict=True):
        steps, force = lines(path, "leg_1/force", f"{root}/")
        assert steps.tolist() == list(range(600))
        assert (force == forces_of(runs / name)[:600]).all()
    assert {path: path.read_bytes() for path in runs.rglob("*") if path.is_file()} == before


@pytest.mark.ci
def test_the_viewer_is_served_to_this_machine_alone_until_interrupted(runs, tmp_path):
    words = (str(runs / "walk"), "--web", "--out", "one.rrd")
    with started(*words, folder=tmp_path, module="cmacexp.replay") as process, ExitStack() as at_end:
        at_end.callback(process.kill)
        # The first viewer of a user greets, in lines before this one.
        address = urlsplit(next(line for line in process.stdout if line.startswith("http")).split()[0])
        assert address.hostname == "127.0.0.1"
        with urlopen(f"http://{address.netloc}/") as page:
            assert page.status == 200
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in errors
    with socket.socket() as connection:
        assert connection.connect_ex((address.hostname, address.port)) != 0
