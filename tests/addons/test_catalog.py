"""Tables of runs: what Rerun's server holds of sweeps, read back by its own client."""

import shutil

import pytest
from support.command import call, python
from support.doors import CmacexpError

import cmacexp
from cmacexp.addons.video.catalog import serve_catalog

pytestmark = pytest.mark.ci
RECORDING = "recording.rrd"


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Two runs, in a process of its own: Rerun's server has threads, which a fork lacks."""
    folder = tmp_path_factory.mktemp("sweeps")
    for number, layers in enumerate((4, 8)):
        words = ["cycles=2", f"cmac.layers={layers}", "record=trace", "gait.cycle_time=0.6", "warn=false"]
        cmacexp.run(words, folder / "a" / str(number))
    words = ("-m", "cmacexp.replay", "a", "--table", "--no-viewer")
    done = python(*words, folder=folder, RUST_LOG="error")
    assert (done.returncode, len(done.stdout.splitlines())) == (0, 1), done.stderr
    return folder / "a"


@pytest.fixture
def copy(sweep, tmp_path):
    return shutil.copytree(sweep, tmp_path / "deep" / "b")


def rows(*folders, keys=()):
    runs = [cmacexp.load(path.parent) for folder in folders for path in sorted(folder.rglob(RECORDING))]
    with serve_catalog(runs, keys) as (address, entry):
        assert address.startswith("rerun+http://127.0.0.1:")
        return entry.segment_table().to_arrow_table()


def test_a_sweep_becomes_a_table_of_its_jobs(sweep):
    table = rows(sweep, keys=["cmac.layers"])
    assert sorted(table["property:config:cmac_layers"].to_pylist()) == [[4], [8]]
    assert table["property:run:status"].to_pylist() == [["completed"]] * 2
    assert len({cell[0] for cell in table["property:metrics:force_rmse"].to_pylist()}) == 2


def test_copies_of_runs_are_different_runs_once_their_recordings_are_built_anew(sweep, copy):
    with pytest.raises(CmacexpError, match="--rebuild"):
        rows(sweep, copy)
    for folder in copy.iterdir():
        assert call("replay", folder, "--rebuild", "--no-viewer").returncode == 0
    assert rows(sweep, copy).num_rows == 4


def test_what_cannot_be_shown_is_named_and_left_out(copy):
    (copy / "1" / RECORDING).unlink()
    (copy / "1" / "trace.parquet").write_bytes(b"")
    done = call("replay", copy, "--table", "--no-viewer")
    assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
    assert "b/1/trace.parquet" in done.stderr
    assert call("replay", copy / "1", "--table", "--no-viewer").returncode == 2
