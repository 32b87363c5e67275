"""Folders of results: nothing of others replaced, an earlier result whole until the next one takes its place."""

import os
import shutil
from contextlib import suppress
from pathlib import Path
from unittest.mock import Mock

import pytest
from support.command import call
from support.doors import BadInput, CmacexpError, Report, compose_config, run_scenario, write_report
from support.manifests import change_manifest

import cmacexp
from cmacexp.data.files import lock, name_part, write_atomically
from cmacexp.data.folder import collection
from cmacexp.data.integrity import faults
from cmacexp.data.manifest import read_file

JOB = ("scenario=force_step", "gait.cycle_time=1.0", "record=trace")
OTHER_MASS = 0.6
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
def test_what_killed_writers_left_goes_and_what_lives_or_shows_no_lock_stays(of_sweep, tmp_path):
    """That a process lives is known by its lock, not by a number that another machine or container has too."""
    dead, alive, strange = parts = [name_part(tmp_path / "run") for _ in range(3)]
    for part in parts:
        (part / "result").mkdir(parents=True)
    os.close(lock(dead / "lock"))
    held = lock(alive / "lock")
    if of_sweep:
        with collection(tmp_path, "hydra.sweep.dir"):
            pass
    else:
        run(tmp_path / "run")
    assert [part.exists() for part in parts] == [False, True, True]
    os.close(held)
    assert strange.exists()


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


OTHERS = (
    "job.log",
    ".notes",
    "notes.txt",
    "report/mine.json",
    "report/figures/mine.svg",
    ".hydra/mine",
    "mine/empty",
)


@pytest.mark.parametrize("name", OTHERS)
def test_a_folder_with_files_of_others_is_refused_by_their_names_and_stays(name, first):
    write_page(first / "report")
    path = first / name
    path.parent.mkdir(exist_ok=True)
    if name == "mine/empty":
        path = path.parent
    else:
        path.write_text("mine")
    before = state_of(first)
    for refused in (run_other, lambda folder: write_page(folder / "report")) if "report" in name else (run_other,):
        with pytest.raises(BadInput, match="which is of no earlier result"):
            refused(first)
    assert state_of(first) == before
    assert path.exists()
    path.rmdir() if path.is_dir() else path.unlink()
    with suppress(OSError):  # it is not empty
        path.parent.rmdir()
    run_other(first)


def test_a_run_and_a_report_replace_only_their_own_kind(first, tmp_path):
    write_page(tmp_path / "page")
    for folder, others in ((first, write_page), (tmp_path / "page", run)):
        before = state_of(folder)
        with pytest.raises(BadInput):
            others(folder)
        assert state_of(folder) == before


def test_a_report_of_an_earlier_version_is_replaced_but_nothing_that_came_after_it(tmp_path):
    write_page(tmp_path / "page")
    change_manifest(tmp_path / "page", files={})
    write_page(tmp_path / "page")
    change_manifest(tmp_path / "page", files={})
    (tmp_path / "page" / "mine.json").write_text("mine")
    os.utime(tmp_path / "page" / "manifest.json", (1, 1))
    with pytest.raises(BadInput, match=r"mine\.json"):
        write_page(tmp_path / "page")


def test_a_report_of_a_stranger_names_no_file_outside_that_is_removed(tmp_path):
    (tmp_path / "mine").write_text("mine")
    for files in ({"../mine": "", str(tmp_path / "mine"): ""}, 7):
        write_page(tmp_path / "page")
        own = read_file(tmp_path / "page" / "manifest.json")["files"]
        change_manifest(tmp_path / "page", files=own | files if isinstance(files, dict) else files)
        with suppress(BadInput):
            write_page(tmp_path / "page")
        assert (tmp_path / "mine").read_text() == "mine"


def test_a_new_run_takes_the_views_of_the_earlier_one_with_it_and_stays_the_current_folder(first, monkeypatch):
    write_page(first / "report")
    (first / ".hydra").mkdir()
    monkeypatch.chdir(first)
    run_other(first)
    assert {path.name for path in Path.cwd().iterdir()} == {path.name for path in first.iterdir()}
    assert not (first / "report").exists()


@pytest.mark.parametrize("is_new", [True, False])
def test_what_others_write_while_a_run_goes_on_stays_and_the_run_stands_beside_it(is_new, first, tmp_path, capsys):
    folder, mine = (tmp_path / "new" if is_new else first), {"debug.csv": b"of a component"}
    before = {} if is_new else state_of(first)

    def log(cycle):
        folder.mkdir(exist_ok=True)
        (folder / "debug.csv").write_bytes(mine["debug.csv"])

    done = run(folder, f"machine.mass={OTHER_MASS}", watch=log)
    assert state_of(folder) == before | mine
    assert done.folder == folder.with_name(f"{folder.name}.completed")
    assert (mass_of(done.folder), faults(done.folder)) == (OTHER_MASS, [])
    assert f"{folder} stays as it was; the completed result is in {done.folder}" in capsys.readouterr().err


def interrupt(cycle):
    raise KeyboardInterrupt


def end_early(folder, status, monkeypatch):
    """Run into a folder; the run is interrupted, or its weights cannot be written."""
    if status == "failed":
        monkeypatch.setattr("cmacexp.engine.run._write_extras", Mock(side_effect=OSError(5, "Input/output error")))
    return run(
        folder, f"machine.mass={OTHER_MASS}", watch=interrupt if status == "interrupted" else lambda cycle: None
    )


@pytest.mark.parametrize("status", ["interrupted", "failed"])
def test_a_worse_result_stands_beside_a_better_one_and_a_later_one_takes_its_place(
    status, first, monkeypatch, capsys
):
    before = state_of(first)
    for _ in range(2):
        worse = end_early(first, status, monkeypatch)
        assert (worse.folder, worse.status) == (first.with_name(f"first.{status}"), status)
        assert str(worse.folder) in capsys.readouterr().err
    assert state_of(first) == before
    assert (mass_of(worse.folder), faults(worse.folder)) == (OTHER_MASS, [])
    assert not list(first.parent.glob("*.2")), "of two of a kind the later one counts"
    assert end_early(first.with_name("other"), status, monkeypatch).folder == first.with_name("other")
    monkeypatch.undo()
    assert run(first.with_name("other")).folder == first.with_name("other"), "a better one takes its place"


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


def test_of_an_earlier_and_a_new_result_one_is_whole_at_every_moment(first, monkeypatch):
    """Looked at before and after every rename, where a kill can leave them."""
    seen, before, rename = [], mass_of(first), Path.rename

    def look(*paths):
        here = [path for path in (first, first.with_name("first.earlier")) if path.exists()]
        seen.append([(path.name, mass_of(path), faults(path)) for path in here])
        return rename(*paths)

    monkeypatch.setattr(Path, "rename", look)
    run_other(first)
    assert (mass_of(first), faults(first), hidden_in(first.parent)) == (OTHER_MASS, [], [])
    assert [("first.earlier", before, [])] in seen
    assert all(len(found) for found in seen)
    assert all((mass, wrong) in ((before, []), (OTHER_MASS, [])) for found in seen for _, mass, wrong in found)


def test_a_result_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    synced, renamed, fsync, rename = set(), [], os.fsync, Path.rename

    def note(descriptor):
        synced.add(os.fstat(descriptor).st_ino)
        fsync(descriptor)

    def look(path, target):
        if target == tmp_path / "run":
            renamed.append({own.name for own in (path, *path.rglob("*")) if own.stat().st_ino not in synced})
        return rename(path, target)

    monkeypatch.setattr(os, "fsync", note)
    monkeypatch.setattr(Path, "rename", look)
    run(tmp_path / "run")
    assert renamed == [set()]
    assert tmp_path.stat().st_ino in synced, "its name, too"


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
