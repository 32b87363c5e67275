"""Folders of results: nothing of others replaced, an earlier result whole until the next one takes its place."""

import os
import shutil
from contextlib import suppress
from pathlib import Path
from unittest.mock import Mock

import pytest
from support.command import KILLING, call, python
from support.doors import BadInput, CmacexpError, Report, compose_config, run_scenario, write_report

import cmacexp
from cmacexp.data.files import name_part, write_atomically
from cmacexp.data.folder import collection
from cmacexp.data.integrity import faults

JOB = ("scenario=force_step", "gait.cycle_time=1.0", "record=trace")
OTHER_MASS = 0.6
NOBODY = 2**22 + 1
"""No process of Linux has this number."""
PAGE = Report("T", "S", [])


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


@pytest.mark.ci
def test_of_two_runs_in_one_folder_the_last_one_stays_and_says_so(tmp_path, capsys):
    masses = []

    def meanwhile(cycle):
        if not masses:
            run_other(tmp_path / "run")
            masses.append(mass_of(tmp_path / "run"))

    run(tmp_path / "run", watch=meanwhile)
    assert masses == [OTHER_MASS]
    assert mass_of(tmp_path / "run") != OTHER_MASS
    assert capsys.readouterr().err.count("another run was written there meanwhile") == 1
    run(tmp_path / "run")
    assert (faults(tmp_path / "run"), hidden_in(tmp_path), capsys.readouterr().err) == ([], [], "")


@pytest.mark.parametrize("of_sweep", [False, True])
def test_what_killed_writers_left_goes_and_what_others_write_stays(of_sweep, tmp_path):
    own, here = name_part(tmp_path / "run"), f".{os.uname().nodename}."
    left = own.with_name(own.name.replace(f".{os.getpid()}.", f".{NOBODY}."))
    elsewhere = left.with_name(left.name.replace(here, ".another."))
    for part in (own, left, elsewhere):
        part.mkdir()
        (part / "trace.parquet").touch()
    if of_sweep:
        with collection(tmp_path, "hydra.sweep.dir"):
            pass
    else:
        run(tmp_path / "run")
    assert [part.exists() for part in (own, left, elsewhere)] == [True, False, True]


FOREIGN = {
    "a table": {"metrics.csv": b"mine"},
    "a trace": {"trace.parquet": b"mine"},
    "a recording": {"recording.rrd": b"mine"},
    "a page": {"report.html": b"mine"},
    "a broken manifest": {"manifest.json": b"{"},
    "a manifest of another program": {"manifest.json": b'{"name": "app"}'},
    "files of another program": {".hydra/config.yaml": b"theirs", "model.pt": b"theirs"},
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


def write_page(folder):
    write_report(PAGE, folder)


def test_a_run_and_a_report_replace_only_their_own_kind_and_no_files_of_others(first, tmp_path):
    write_page(tmp_path / "page")
    for folder, again, others in ((first, run_other, write_page), (tmp_path / "page", write_page, run)):
        for name in ("job.log", ".notes.part", "notes.txt"):
            (folder / name).write_text("mine")
        before = state_of(folder)
        for refused in (again, others):
            with pytest.raises(BadInput):
                refused(folder)
        assert state_of(folder) == before
        (folder / "notes.txt").unlink()
        again(folder)
        assert state_of(folder).items() >= {"job.log": b"mine", ".notes.part": b"mine"}.items()


def test_a_new_run_takes_the_views_of_the_earlier_one_with_it_and_stays_the_current_folder(first, monkeypatch):
    write_page(first / "report")
    (first / ".hydra").mkdir()
    monkeypatch.chdir(first)

    def log(cycle):
        Path("debug.csv").write_text("of a component")

    run(first, f"machine.mass={OTHER_MASS}", watch=log)
    assert {path.name for path in Path.cwd().iterdir()} == {path.name for path in first.iterdir()}
    assert {path.name for path in first.iterdir()} & {"report", ".hydra", "debug.csv"} == {"debug.csv"}


def test_the_folder_of_the_shell_and_a_mount_point_are_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("PWD", str(tmp_path))
    for folder in (tmp_path, Path("/proc")):
        with pytest.raises(BadInput, match=r"hydra\.run\.dir=.*cannot be replaced"):
            run(folder)


def test_a_link_to_the_folder_of_a_run_stays_one(first, tmp_path):
    (tmp_path / "link").symlink_to(first)
    run_other(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert mass_of(first) == OTHER_MASS


def fill_the_disk(monkeypatch, folder):
    """The disk is full while the trace is written."""
    full = Mock(side_effect=OSError(28, "No space left on device"))
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


@pytest.mark.parametrize("exchanged", [True, False])
def test_a_result_is_whole_at_every_moment_or_absent_where_folders_cannot_be_exchanged(exchanged, first, monkeypatch):
    """Looked at before and after every rename, where a kill can leave it."""
    seen, before, rename = [], mass_of(first), Path.rename

    def look(*paths):
        seen.append(first.exists() and (mass_of(first), faults(first)))
        return rename(*paths)

    monkeypatch.setattr(Path, "rename", look)
    if not exchanged:
        monkeypatch.setattr("cmacexp.data.folder._exchange", lambda *paths: False)
    run_other(first)
    assert (mass_of(first), faults(first), hidden_in(first.parent)) == (OTHER_MASS, [], [])
    assert all(found == (before, []) for found in seen if found)
    assert (False in seen) != exchanged


@pytest.mark.ci
def test_a_run_killed_at_any_moment_leaves_nothing_broken_and_can_be_run_again(tmp_path):
    words = ("cycles=2", "hydra.run.dir=out")
    done = python(KILLING, "3", "1", str(tmp_path), *words, folder=tmp_path)
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
    (tmp_path / "new").symlink_to(tmp_path / "mine")
    with write_atomically(tmp_path / "new") as temporary:
        temporary.write_text("whole")
    assert state_of(tmp_path) == {"new": b"whole"}
