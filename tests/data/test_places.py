"""Folders of results: one writer at a time, nothing of others replaced, an earlier result whole until the next is."""

import json
import os
from importlib import import_module
from pathlib import Path

import pytest
from support.command import cmacexp

from cmacexp import load as cmacexp_load
from cmacexp.commands import report
from cmacexp.commands.score import score
from cmacexp.config.compose import compose_config
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import runs_below
from cmacexp.data.folder import locked, write_atomically
from cmacexp.data.integrity import faults
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadInput, BadRun
from cmacexp.experiment.run import run_scenario
from cmacexp.report.page import Report, write_report

JOB = ["scenario=force_step", "gait.cycle_time=1.0", "record=trace"]


def run(folder, *overrides):
    return run_scenario(compose_config([*JOB, *overrides]), folder)


def state_of(folder):
    """All that a folder holds, hidden files included."""
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def first(tmp_path):
    run(tmp_path / "first")
    return tmp_path / "first"


def test_of_two_runs_in_one_folder_one_is_refused(tmp_path):
    refused = []

    def meanwhile(cycle):
        with pytest.raises(BadInput) as caught:
            run(tmp_path / "r", "machine.mass=0.6")
        refused.append(caught.value.key)

    run_scenario(compose_config(JOB), tmp_path / "r", meanwhile)
    assert {*refused} == {"hydra.run.dir"}
    assert not faults(tmp_path / "r")
    assert StoredRun(tmp_path / "r").config["machine"]["mass"] != 0.6
    assert not list((tmp_path / "r").glob(".*"))


def test_the_lock_ends_with_its_holder_and_a_waiting_process_gets_it(tmp_path):
    ready, go = os.pipe(), os.pipe()
    process = os.fork()
    if not process:
        with locked(tmp_path / "r", "key"):
            os.write(ready[1], b"x")
            os.read(go[0], 1)
            os._exit(0)  # without unlocking, as one that is killed
    os.read(ready[0], 1)
    with pytest.raises(BadInput, match=f"process {process} writes here"), locked(tmp_path / "r", "key"):
        pass
    os.write(go[1], b"x")
    with locked(tmp_path / "r", "key", wait=True):
        assert os.waitpid(process, 0)[1] == 0
    assert not list((tmp_path / "r").iterdir())


def test_two_sweeps_at_once_do_not_share_a_folder(tmp_path):
    (tmp_path / "s").mkdir()
    with locked(tmp_path / "s", "key"):
        done = cmacexp("-m", "seed=0,1", "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith(f"error: hydra.sweep.dir=s: process {os.getpid()} ")
        assert not [path for path in (tmp_path / "s").iterdir() if not path.name.startswith(".")]


@pytest.mark.parametrize("name", ["metrics.csv", "trace.parquet", "recording.rrd"])
def test_a_file_of_the_user_is_not_replaced(name, tmp_path):
    (tmp_path / name).write_text("mine")
    with pytest.raises(BadInput, match=name):
        run(tmp_path)
    assert state_of(tmp_path) == {Path(name): b"mine"}


@pytest.mark.parametrize("text", ["{", '{"name": "app"}', "[1]"])
def test_another_manifest_is_not_replaced(text, tmp_path):
    (tmp_path / "manifest.json").write_text(text)
    for write in (run, lambda folder: write_report(Report("T", "S", [], []), folder)):
        with pytest.raises(BadInput) as caught:
            write(tmp_path)
        assert "\n" not in str(caught.value)
        assert state_of(tmp_path) == {Path("manifest.json"): text.encode()}


def test_files_with_other_names_stay(first):
    for name in ("notes.txt", ".notes.part", ".trace.part"):
        (first / name).write_text("mine")
    run(first, "machine.mass=0.6")
    assert StoredRun(first).config["machine"]["mass"] == 0.6
    assert all((first / name).read_text() == "mine" for name in ("notes.txt", ".notes.part", ".trace.part"))
    assert not faults(first)


def test_the_record_of_another_program_is_not_replaced(tmp_path):
    (tmp_path / ".hydra").mkdir()
    (tmp_path / ".hydra" / "config.yaml").write_text("theirs")
    (tmp_path / "model.pt").write_text("theirs")
    with pytest.raises(BadInput):
        run(tmp_path)
    assert (tmp_path / ".hydra" / "config.yaml").read_text() == "theirs"


def test_the_folder_of_a_run_killed_before_its_end_can_be_used(tmp_path):
    new = tmp_path / "r" / ".cmacexp-new"
    (new / ".hydra").mkdir(parents=True)
    (new / "trace.parquet").write_text("half")
    assert runs_below(tmp_path) == [tmp_path / "r"]
    assert faults(tmp_path / "r")
    run(tmp_path / "r")
    assert not faults(tmp_path / "r")
    assert not list((tmp_path / "r").glob(".*"))


def test_bad_input_leaves_an_earlier_run_as_it_was(tmp_path):
    assert cmacexp(*JOB, "hydra.run.dir=r", folder=tmp_path).returncode == 0
    before = state_of(tmp_path / "r")
    assert Path(".hydra/overrides.yaml") in before
    assert b"gait.cycle_time=1.0" in before[Path(".hydra/overrides.yaml")]
    assert cmacexp(*JOB, "cycles=0", "hydra.run.dir=r", folder=tmp_path).returncode == 2
    assert state_of(tmp_path / "r") == before


def test_a_run_does_not_start_from_weights_that_it_would_replace(tmp_path):
    whole = ["cycles=1", "record=trace", "record.weights=true"]
    run_scenario(compose_config(whole), tmp_path / "w")
    before = state_of(tmp_path / "w")
    config = compose_config([*whole, f"learning.start_from={tmp_path / 'w'}"])
    with pytest.raises(BadInput, match=r"learning\.start_from="):
        run_scenario(config, tmp_path / "w" / ".." / "w")
    assert state_of(tmp_path / "w") == before


def test_a_report_replaces_a_report_alone(first, tmp_path):
    before = state_of(first)
    with pytest.raises(BadInput):
        write_report(Report("T", "S", [], []), first)
    assert state_of(first) == before
    write_report(Report("T", "S", [], []), tmp_path / "page")
    (tmp_path / "page" / "notes.txt").write_text("mine")
    write_report(Report("Second", "S", [], []), tmp_path / "page")
    assert "Second" in (tmp_path / "page" / "report.html").read_text()
    assert (tmp_path / "page" / "notes.txt").exists()
    with pytest.raises(BadInput):
        run(tmp_path / "page")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "report.html").write_text("mine")
    with pytest.raises(BadInput):
        write_report(Report("T", "S", [], []), tmp_path / "mine")


def test_a_report_removes_nothing_that_it_was_made_from(first, tmp_path):
    page = Report("T", "S", [], [first / "trace.parquet"])
    for _ in range(2):
        write_report(page, tmp_path)
        assert set(manifests.read(tmp_path)["files"]) == {"report.html", "first/trace.parquet"}
    write_report(Report("T", "S", [], []), tmp_path)
    assert not faults(first)


@pytest.mark.parametrize("name", ["sweep.csv", "sweep.parquet"])
def test_a_table_of_the_user_is_not_replaced_by_that_of_a_sweep(name, tmp_path):
    (tmp_path / name).write_text("a,b\n1,2\n")
    done = cmacexp("-m", "seed=0", "cycles=1", f"hydra.sweep.dir={tmp_path}", folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert (tmp_path / name).read_text() == "a,b\n1,2\n"


def test_a_job_that_fails_leaves_the_earlier_run_and_says_so_in_the_table(tmp_path):
    import pandas as pd

    assert cmacexp("-m", *JOB, "seed=0,1", "hydra.sweep.dir=s", folder=tmp_path).returncode == 0
    before = state_of(tmp_path / "s" / "0")
    bad = ["-m", *JOB, "seed=0,1", "machine.mass=-1", "hydra.sweep.dir=s"]
    assert cmacexp(*bad, folder=tmp_path).returncode == 2
    assert pd.read_parquet(tmp_path / "s" / "sweep.parquet")["status"].tolist() == ["failed", "failed"]
    assert {path: text for path, text in state_of(tmp_path / "s" / "0").items() if path in before} == before
    assert runs_below(tmp_path / "s") == [tmp_path / "s" / "0", tmp_path / "s" / "1"]
    assert cmacexp("-m", *JOB, "seed=0,1", "hydra.sweep.dir=s", "sweep.resume=true", folder=tmp_path).returncode == 0
    assert pd.read_parquet(tmp_path / "s" / "sweep.parquet")["status"].tolist() == ["completed", "completed"]
    assert not list(tmp_path.rglob(".cmacexp*"))


@pytest.fixture
def interrupted(first, monkeypatch):
    """``interrupted(n)``: the folder of an earlier run whose replacement is killed before its file number ``n``."""

    def kill(number):
        replace, left = Path.replace, iter(range(number))

        def killed(self, target):
            if self.parent.name == ".cmacexp-new" and next(left, None) is None:
                raise KeyboardInterrupt
            return replace(self, target)

        with monkeypatch.context() as patch:
            patch.setattr(Path, "replace", killed)
            with pytest.raises(KeyboardInterrupt):
                run(first, "machine.mass=0.6")
        return first

    return kill


@pytest.mark.parametrize("number", range(4))
def test_an_interrupted_replacement_is_named_by_readers_and_completed_by_the_next_writer(interrupted, number):
    folder = interrupted(number)
    before = state_of(folder)
    for read in (lambda: StoredRun(folder).manifest, lambda: cmacexp_load(folder), lambda: manifests.read(folder)):
        with pytest.raises(BadRun, match="interrupted"):
            read()
    (fault,) = faults(folder)
    assert "interrupted" in fault
    assert state_of(folder) == before, "readers change nothing"
    score(folder)
    assert StoredRun(folder).config["machine"]["mass"] == 0.6
    assert not faults(folder)
    assert not list(folder.glob(".cmacexp*"))


def make_foreign(folder, link, target):
    """A run of somebody else whose replacement is interrupted, with a link in it."""
    new = folder / ".cmacexp-new"
    new.mkdir()
    (folder / "manifest.json").rename(new / "manifest.json")
    (new / ".obsolete.json").write_text(json.dumps(["../thesis.tex", str(folder.parent / "thesis.tex")]))
    (folder / link).parent.mkdir(exist_ok=True)
    (folder / link).symlink_to(target)
    (new / "p").mkdir()
    (new / "p" / "matplotlib.py").write_text("raise RuntimeError")


@pytest.mark.parametrize("link", ["p", ".hydra", "report", ".cmacexp-lock", "notes"])
def test_a_folder_of_somebody_else_can_do_nothing_outside_it(first, tmp_path, monkeypatch, link):
    outside = tmp_path / "outside"
    outside.mkdir()
    (tmp_path / "thesis.tex").write_text("mine")
    make_foreign(first, link, outside)
    if link == "notes":
        os.link(tmp_path / "thesis.tex", first / ".cmacexp-lock")
    for command in ("verify", "report", "replay", "score", "stability"):
        monkeypatch.setattr("sys.argv", [command, str(first), *(["--no-viewer"] if command == "replay" else [])])
        import_module(f"cmacexp.commands.{command}").main()
        assert (tmp_path / "thesis.tex").read_text() == "mine"
        assert not list(outside.iterdir()), command


def test_a_report_follows_no_link(first, tmp_path, monkeypatch):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "metrics.svg").write_text("mine")
    monkeypatch.setattr("sys.argv", ["report", str(first)])
    (first / "report").symlink_to(outside)
    assert report.main() == 2
    (first / "report").unlink()
    (first / "report").mkdir()
    (first / "report" / "figures").symlink_to(outside)
    assert report.main() == 2
    assert {path.name for path in outside.iterdir()} == {"metrics.svg"}


def test_a_report_that_was_killed_while_drawing_does_not_block_the_next(first, monkeypatch):
    drawn = first / "report" / ".cmacexp-new" / "figures"
    drawn.mkdir(parents=True)
    (drawn / "metrics.svg").write_text("half")
    assert runs_below(first.parent) == [first]
    monkeypatch.setattr("sys.argv", ["report", str(first)])
    assert report.main() == 0
    assert not faults(first / "report")
    assert not list((first / "report").glob(".cmacexp*"))


def test_a_full_disk_keeps_an_earlier_run_and_is_one_line(first, monkeypatch):
    def full(self, traces):
        raise OSError(28, "No space left on device")

    before = state_of(first)
    with monkeypatch.context() as patch:
        patch.setattr("cmacexp.data.tables.TraceWriter.write", full)
        with pytest.raises(OSError, match="disk full: "):
            run(first, "machine.mass=0.6")
    assert state_of(first) == before


def test_a_disk_that_is_full_for_the_recording_leaves_a_folder_that_can_be_used_again(tmp_path, monkeypatch):
    def full(*arguments, **named):
        raise OSError(28, "No space left on device")

    config = compose_config(["scenario=one_leg", "cycles=1", "record.weights=true"])
    with monkeypatch.context() as patch:
        patch.setattr("cmacexp.recording.write.write_recording", full)
        assert run_scenario(config, tmp_path / "r").status == "failed"
    assert not faults(tmp_path / "r")
    files = {*manifests.read(tmp_path / "r")["files"], manifests.NAME}
    assert files == {path.name for path in (tmp_path / "r").iterdir()}
    assert "weights.npz" in files
    assert run_scenario(config, tmp_path / "r").status == "completed"


def test_a_file_is_written_as_a_whole_and_never_through_a_link(tmp_path):
    (tmp_path / f".new.{os.getpid()}.part").symlink_to(tmp_path / "mine")
    with write_atomically(tmp_path / "new") as temporary:
        temporary.write_text("whole")
    assert state_of(tmp_path) == {Path("new"): b"whole"}
