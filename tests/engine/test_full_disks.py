"""A full disk, a folder that cannot be written: one line, and nothing broken stays under a final name."""

import os
import pickle
import resource
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from support.command import call, environment
from support.doors import BadComponent, BadInput

from cmacexp import load


def on_a_small_disk(size, *arguments, folder):
    """The command line where no file can have more than ``size`` bytes."""
    done = subprocess.run(
        [sys.executable, "-m", "cmacexp", *arguments],
        cwd=folder,
        env=environment(),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    return done


@pytest.mark.ci
@pytest.mark.parametrize(
    ("size", "kept"),
    [
        (20_000, None),
        (700_000, {"trace.parquet", "memory.parquet", "metrics.parquet", "metrics.csv", "manifest.json"}),
    ],
)
def test_a_full_disk_is_one_line_and_keeps_nothing_half_written(size, kept, tmp_path):
    done, out = on_a_small_disk(size, "cycles=5", "hydra.run.dir=out", folder=tmp_path), tmp_path / "out"
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert "disk full" in line
    assert out.exists() == bool(kept)
    if kept:
        assert {path.name for path in out.glob("*")} - {".hydra"} == kept
        assert call("verify", out).returncode == 0
        assert load(out).status == "failed"


@pytest.mark.ci
def test_a_full_disk_in_a_sweep_fails_the_jobs_that_do_not_fit(tmp_path):
    on_a_small_disk(300_000, "-m", "cycles=1,20", "hydra.sweep.dir=out", folder=tmp_path)
    table = pd.read_parquet(tmp_path / "out" / "sweep.parquet")
    assert table["status"].tolist() == ["completed", "failed"]
    assert [path.name for path in (tmp_path / "out" / "1").iterdir() if path.name != ".hydra"] == ["manifest.json"]


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
    done = call("main", *given, "cycles=1", folder=tmp_path_factory.mktemp("here"))
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert f"{locked}/out" in line
    assert not (locked / "out").exists()


@pytest.mark.parametrize(
    "error",
    [
        BadInput("cmac.layers", 0, "must be at least 1"),
        BadComponent("plant", {"a": 1}, "fell\nover", ValueError("over")),
    ],
)
def test_what_a_worker_finds_wrong_comes_back_whole_and_in_one_line(error):
    back = pickle.loads(pickle.dumps(error))
    assert (type(back), str(back), back.key) == (type(error), str(error), error.key)
    assert "\n" not in str(back)
