"""Kills at random moments, a full disk, a folder that cannot be written: nothing broken stays under a final name."""

import errno
import os
import pickle
import resource
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from support.command import ROOT, cmacexp, python

from cmacexp.commands.main import _end_sweep
from cmacexp.data.integrity import faults
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadComponent, BadInput
from cmacexp.experiment.sweep import Sweep

KILLING = str(Path(__file__).parents[1] / "support" / "killing.py")
SWEEP = ["-m", "cmac.layers=8,10,16,32", "cycles=2", "hydra.sweep.dir=out"]


def test_a_run_killed_at_any_moment_leaves_nothing_broken_and_can_be_run_again(tmp_path):
    run = ["cycles=2", "hydra.run.dir=out"]
    done = python(KILLING, "3", "1", str(tmp_path), *run, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert cmacexp(*run, folder=tmp_path).returncode == 0
    assert not faults(tmp_path / "out")
    assert not list((tmp_path / "out").glob(".cmacexp*"))


def test_a_sweep_killed_at_any_moment_resumes_to_what_it_would_have_been(tmp_path):
    done = python(KILLING, "3", "2", str(tmp_path), *SWEEP, "sweep.resume=true", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert cmacexp(*SWEEP, "sweep.resume=true", folder=tmp_path).returncode == 0
    (tmp_path / "other").mkdir()
    assert cmacexp(*SWEEP, folder=tmp_path / "other").returncode == 0
    resumed, undisturbed = (
        pd.read_parquet(folder / "out" / "sweep.parquet") for folder in (tmp_path, tmp_path / "other")
    )
    pd.testing.assert_frame_equal(resumed, undisturbed)
    assert not list(tmp_path.rglob(".cmacexp*"))


def on_a_small_disk(size: int, *arguments: str, folder: Path) -> subprocess.CompletedProcess:
    """The command line where no file can have more than ``size`` bytes."""
    return subprocess.run(
        [sys.executable, "-m", "cmacexp", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize(("size", "refused"), [(20_000, "trace.parquet"), (700_000, "recording.rrd")])
def test_a_full_disk_is_a_clear_error_and_keeps_nothing_half_written(size, refused, tmp_path):
    done = on_a_small_disk(size, "cycles=5", "hydra.run.dir=out", folder=tmp_path)
    assert done.returncode == 1
    (told,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert "disk full: " in told
    assert told.endswith("cannot be written: file too large; make room, or choose another folder")
    assert "Traceback" not in done.stderr
    if refused == "trace.parquet":
        assert not (tmp_path / "out").exists()
    else:
        kept = {path.name for path in (tmp_path / "out").glob("*")} - {".hydra"}
        assert kept == {"trace.parquet", "memory.parquet", "metrics.parquet", "metrics.csv", "manifest.json"}
        assert not faults(tmp_path / "out")
        assert StoredRun(tmp_path / "out").status == "failed"


def test_a_full_disk_in_a_sweep_fails_the_jobs_that_do_not_fit(tmp_path):
    done = on_a_small_disk(300_000, "-m", "cycles=1,20", "hydra.sweep.dir=out", folder=tmp_path)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    table = pd.read_parquet(tmp_path / "out" / "sweep.parquet")
    assert table["status"].tolist() == ["completed", "failed"]
    assert table["cause"][1].endswith("cannot be written: file too large; make room, or choose another folder")
    assert [path.name for path in (tmp_path / "out" / "1").iterdir() if path.name != ".hydra"] == ["manifest.json"]


def test_a_disk_too_full_for_the_table_of_a_sweep_is_named(tmp_path, monkeypatch):
    def write(sweep):
        raise OSError(errno.ENOSPC, "Error writing bytes to file")

    monkeypatch.setattr(Sweep, "current", Sweep(tmp_path))
    monkeypatch.setattr("cmacexp.experiment.sweep_results.finish_sweep", write)
    with pytest.raises(
        OSError, match=f"disk full: {tmp_path}: cannot be written: no space left on device; make room"
    ):
        _end_sweep()


@pytest.fixture
def locked(tmp_path):
    """A folder in which nothing can be made: root is held by the kernel's own alone."""
    if os.getuid() == 0:
        yield Path("/sys")
    else:
        tmp_path.chmod(0o555)
        yield tmp_path
        tmp_path.chmod(0o755)


@pytest.mark.parametrize("arguments", [["hydra.run.dir={}/out"], ["-m", "seed=0,1", "hydra.sweep.dir={}/out"]])
def test_a_folder_that_cannot_be_written_is_one_line(arguments, locked, tmp_path_factory):
    given = [text.format(locked) for text in arguments]
    done = cmacexp(*given, "cycles=1", folder=tmp_path_factory.mktemp("here"))
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert f"{locked}/out" in done.stderr
    assert not (locked / "out").exists()


@pytest.mark.parametrize(
    "error",
    [
        BadInput("cmac.layers", 0, "must be at least 1"),
        BadComponent("plant", {"a": 1}, "fell\nover", ValueError("over")),
    ],
)
def test_what_a_worker_finds_wrong_comes_back_whole(error):
    back = pickle.loads(pickle.dumps(error))
    assert (type(back), str(back), back.key) == (type(error), str(error), error.key)
    assert "\n" not in str(back)
