"""Folders of results: one writer at a time, nothing of others replaced, an earlier result whole until the next is."""

import os
import shutil
from contextlib import nullcontext, suppress
from pathlib import Path

import pytest
from support.command import ROOT, call, python
from support.doors import BadInput, CmacexpError, Report, compose_config, run_scenario, write_report

import cmacexp
from cmacexp.data.folder import write_atomically
from cmacexp.data.integrity import faults

JOB = ("scenario=force_step", "gait.cycle_time=1.0", "record=trace")
OTHER_MASS = 0.6
KILLING = ROOT / "tests" / "support" / "killing.py"
PAGE = Report("T", "S", [], [])


def run(folder, *overrides, watch=lambda cycles: None):
    return run_scenario(compose_config([*JOB, *overrides]), folder, watch)


def run_other(folder):
    return run(folder, f"machine.mass={OTHER_MASS}")


def mass_of(folder):
    return cmacexp.load(folder).config["machine"]["mass"]


def state_of(folder):
    """All that a folder holds, hidden files included."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def hidden_in(folder):
    return [path for path in folder.rglob(".*") if path.name != ".hydra"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return run(tmp_path_factory.mktemp("made") / "run").folder


@pytest.fixture
def first(made, tmp_path):
    """The folder of an earlier run."""
    return shutil.copytree(made, tmp_path / "first")


def test_of_two_runs_in_one_folder_one_is_refused(tmp_path):
    refused = []

    def meanwhile(cycle):
        with pytest.raises(BadInput) as caught:
            run_other(tmp_path / "run")
        refused.append(caught.value.key)

    run(tmp_path / "run", watch=meanwhile)
    assert {*refused} == {"hydra.run.dir"}
    assert not faults(tmp_path / "run")
    assert mass_of(tmp_path / "run") != OTHER_MASS
    assert not hidden_in(tmp_path)


FOREIGN = {
    "a table": {"metrics.csv": b"mine"},
    "a trace": {"trace.parquet": b"mine"},
    "a recording": {"recording.rrd": b"mine"},
    "a page": {"report.html": b"mine"},
    "a broken manifest": {"manifest.json": b"{"},
    "a manifest of another program": {"manifest.json": b'{"name": "app"}'},
    "Hydra's record of another program": {".hydra/config.yaml": b"theirs", "model.pt": b"theirs"},
}


@pytest.mark.parametrize("files", FOREIGN.values(), ids=FOREIGN)
def test_files_of_others_are_not_replaced(files, tmp_path):
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    write = (lambda folder: write_report(PAGE, folder)) if "report.html" in files else run
    with pytest.raises(BadInput):
        write(tmp_path)
    assert state_of(tmp_path) == files


def test_a_run_and_a_report_replace_only_their_own_kind_and_leave_other_files(first, tmp_path):
    page = Report("T", "S", [], [first / "trace.parquet"])
    write_report(page, tmp_path / "page")
    for folder, refused in ((first, lambda folder: write_report(PAGE, folder)), (tmp_path / "page", run)):
        (folder / "notes.txt").write_text("mine")
        (folder / ".notes.part").write_text("mine")
        before = state_of(folder)
        with pytest.raises(BadInput):
            refused(folder)
        assert state_of(folder) == before
    write_report(PAGE, tmp_path / "page")
    run_other(first)
    for folder in (first, tmp_path / "page"):
        assert not faults(folder)
        assert {(folder / name).read_text() for name in ("notes.txt", ".notes.part")} == {"mine"}


@pytest.mark.ci
def test_a_table_of_the_user_is_not_replaced_by_that_of_a_sweep(tmp_path):
    (tmp_path / "sweep.csv").write_text("mine")
    done = call("main", "-m", "seed=0", "cycles=1", f"hydra.sweep.dir={tmp_path}", folder=tmp_path)
    assert (done.returncode, done.stdout, state_of(tmp_path)) == (2, "", {"sweep.csv": b"mine"})


def fill_the_disk(monkeypatch, folder):
    """The disk is full while the trace is written."""

    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("cmacexp.data.trace.TraceWriter.write", full)
    run_other(folder)


FAILING = {
    "a config that cannot be run": lambda folder, _: run(folder, "machine.mass=-1"),
    "a start from the weights that it would replace": lambda folder, _: run(folder, f"learning.start_from={folder}"),
    "a full disk": lambda folder, monkeypatch: fill_the_disk(monkeypatch, folder),
}


@pytest.mark.parametrize("fail", FAILING.values(), ids=FAILING)
def test_what_fails_leaves_the_earlier_run_as_it_was(fail, first, monkeypatch):
    before = state_of(first)
    with pytest.raises((CmacexpError, OSError)):
        fail(first, monkeypatch)
    assert state_of(first) == before


@pytest.mark.parametrize("number", range(4))
def test_a_replacement_interrupted_at_any_moment_leaves_one_result_or_says_so_and_the_next_completes(
    number, first, monkeypatch
):
    """Before the rename of file ``number``; what a reader then takes for a run is a whole one."""
    with monkeypatch.context() as patch:
        for module, name in ((Path, "replace"), (Path, "rename"), (os, "replace"), (os, "rename")):
            rename, left = getattr(module, name), iter(range(number))

            def interrupted(*paths, rename=rename, left=left):
                if next(left, None) is None:
                    raise KeyboardInterrupt
                return rename(*paths)

            patch.setattr(module, name, interrupted)
        with pytest.raises(KeyboardInterrupt) if number == 0 else suppress(KeyboardInterrupt):
            run_other(first)
    before = state_of(first)
    with pytest.raises(CmacexpError) if faults(first) else nullcontext():
        mass_of(first)
    assert state_of(first) == before, "readers change nothing"
    run_other(first)
    assert (mass_of(first), faults(first), hidden_in(first)) == (OTHER_MASS, [], [])


@pytest.mark.ci
def test_a_run_killed_at_any_moment_leaves_nothing_broken_and_can_be_run_again(tmp_path):
    words = ("cycles=2", "hydra.run.dir=out")
    done = python(str(KILLING), "3", "1", str(tmp_path), *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert call("main", *words, folder=tmp_path).returncode == 0
    assert (faults(tmp_path / "out"), hidden_in(tmp_path / "out")) == ([], [])


@pytest.mark.ci
@pytest.mark.parametrize("link", ["report", "stability", ".hydra", "notes"])
def test_commands_follow_no_link_out_of_a_folder(link, first, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "report.html").write_text("mine")
    shutil.rmtree(first / link, ignore_errors=True)
    (first / link).symlink_to(outside)
    for command in ("verify", "report", "score", "stability", "replay"):
        call(command, first, *(["--no-viewer"] if command == "replay" else []))
    with suppress(BadInput):
        run_other(first)
    assert state_of(outside) == {"report.html": b"mine"}


def test_a_file_is_written_as_a_whole_and_never_through_a_link(tmp_path):
    (tmp_path / f".new.{os.getpid()}.part").symlink_to(tmp_path / "mine")
    with write_atomically(tmp_path / "new") as temporary:
        temporary.write_text("whole")
    assert state_of(tmp_path) == {"new": b"whole"}
