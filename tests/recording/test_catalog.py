"""Tables of runs: what Rerun's server holds of sweeps, read back by its own client."""

import shutil
import sys

import pytest
from rerun.chunk import RrdReader
from support.command import cmacexp, python

from cmacexp.commands import replay
from cmacexp.commands.replay import build_missing
from cmacexp.commands.viewer import HOST
from cmacexp.errors import BadRun
from cmacexp.recording.catalog import NAME, serve_catalog

JOBS = 4
RECORDING = "recording.rrd"


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A sweep of 4 jobs without recordings."""
    folder = tmp_path_factory.mktemp("sweeps")
    words = ["-m", "cycles=2", "cmac.layers=4,8", "seed=0,1", "record=trace", "gait.cycle_time=0.6"]
    done = cmacexp(*words, "hydra.sweep.dir=a", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder / "a"


@pytest.fixture(scope="module")
def shown(sweep):
    """The recordings of the sweep."""
    done = show(str(sweep), folder=sweep.parent)
    assert (done.returncode, done.stdout) == (0, "4 of 4 runs in a table, by cmac.layers, seed\n"), done.stderr
    return sorted(sweep.rglob(RECORDING))


def show(*arguments, folder):
    """In a process of its own: Rerun's server has threads, which a fork lacks."""
    return python("-m", "cmacexp.replay", *arguments, "--table", "--no-viewer", folder=folder, RUST_LOG="error")


def rows(paths, keys=()):
    with serve_catalog(paths, keys, HOST) as (address, runs):
        assert address.startswith(f"rerun+http://{HOST}:")
        return runs.segment_table().to_arrow_table()


def test_a_sweep_without_recordings_becomes_a_table_of_its_jobs(shown):
    table = rows(shown, ["cmac.layers", "seed"])
    assert table.num_rows == JOBS
    layers, seeds = (table[f"property:config:{key}"].to_pylist() for key in ("cmac_layers", "seed"))
    assert {(*a, *b) for a, b in zip(layers, seeds, strict=True)} == {(4, 0), (4, 1), (8, 0), (8, 1)}
    assert {cell[0] for cell in table["property:run:status"].to_pylist()} == {"completed"}
    assert "cmac.layers=4 seed=1" in " ".join(cell[0] for cell in table["property:run:overrides"].to_pylist())
    assert len({cell[0] for cell in table["property:metrics:force_rmse"].to_pylist()}) > 1


def test_the_table_begins_with_what_differs_and_the_main_metrics(shown):
    with serve_catalog(shown, ["cmac.layers"], HOST) as (_, runs):
        (layout,) = runs.blueprints()
        assert runs.default_segment_table_blueprint() == layout
        store = runs.blueprint_dataset().segment_store(layout)
        (order,) = [
            row["TableLayout:column_order"]
            for chunk in store.stream().to_chunks()
            for row in chunk.to_record_batch().to_pylist()
            if row.get("TableLayout:column_order")
        ]
    assert order[:3] == [NAME, "property:config:cmac_layers", "property:run:status"]
    assert order[3].startswith("property:metrics:")


def test_jobs_of_the_same_number_of_two_sweeps_are_different_runs(sweep, shown, tmp_path):
    """A copy, below a subfolder, has the ids of its original until its recordings are built anew."""
    other = tmp_path / "deep" / "down" / "b"
    shutil.copytree(sweep, other)
    copied = sorted(other.rglob(RECORDING))
    with pytest.raises(BadRun, match=r"of 8 recordings the server takes 4, .*; --rebuild builds them anew$"):
        rows([*shown, *copied])
    folders = [path.parent for path in (*shown, *copied)]
    assert build_missing(folders, True) == folders
    assert rows([*shown, *copied]).num_rows == 2 * JOBS


def test_each_view_of_a_run_has_an_id_of_its_own(sweep, tmp_path):
    ids = set()
    for number, words in enumerate(([], ["--every", "2"], ["--every", "3"])):
        out = tmp_path / f"{number}.rrd"
        words = ["cmacexp.replay", str(sweep / "0"), "--no-viewer", "--out", str(out), *words]
        assert python("-m", *words, folder=tmp_path).returncode == 0
        ids.add(RrdReader(out).recordings()[0].recording_id)
    assert len(ids) == 3


def test_what_cannot_be_shown_is_named_and_left_out(sweep, shown, tmp_path):
    shutil.copytree(sweep / "0", tmp_path / "a" / "0")
    shutil.copytree(sweep / "1", tmp_path / "a" / "1")
    (tmp_path / "a" / "1" / RECORDING).unlink()
    (tmp_path / "a" / "1" / "trace.parquet").write_bytes(b"")
    done = show("a", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "1 of 2 runs in a table, by nothing in which they differ\n")
    (line,) = done.stderr.splitlines()
    assert line.startswith("left out: a/1/trace.parquet: ")
    done = show("a/1", folder=tmp_path)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (2, "error: a/1: no run can be shown")


def test_windows_do_not_go_with_a_table(sweep):
    done = python("-m", "cmacexp.replay", str(sweep), "--table", "--cycles", "1", "--no-viewer", folder=sweep)
    assert (done.returncode, done.stderr.startswith("error: --cycles=1: ")) == (2, True)


def test_without_the_extra_one_line_says_what_to_install(sweep, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "datafusion", None)
    monkeypatch.setattr(sys, "argv", ["replay", str(sweep), "--table", "--no-viewer"])
    assert replay.main() == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "[catalog]" in line
