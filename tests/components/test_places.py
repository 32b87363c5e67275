"""Folders of results: one writer at a time, nothing of others replaced, an earlier result whole until the next is."""

import json
import os
from itertools import count
from pathlib import Path

import pytest
from support.command import cmacexp
from support.failing import fail

from cmacexp.config.compose import compose_config
from cmacexp.data import manifest as manifests
from cmacexp.data import staging
from cmacexp.data.discovery import runs_below
from cmacexp.data.files import DiskFull, alone_in
from cmacexp.data.integrity import faults
from cmacexp.data.parquet import TableWriter
from cmacexp.data.places import run_place
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadInput
from cmacexp.experiment.run import run_scenario
from cmacexp.experiment.sweep_start import check_tables
from cmacexp.report.page import Report, write_report

JOB = ["scenario=force_step", "gait.cycle_time=1.0", "record=trace"]
ALL_WRITES = "CMACEXP_ALL_WRITES"


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
        refused.append(str(caught.value))

    run_scenario(compose_config(JOB), tmp_path / "r", meanwhile)
    (told,) = set(refused)
    assert told == (
        f"hydra.run.dir={tmp_path / 'r'}: process {os.getpid()} writes here; "
        "wait until it has ended, or choose another folder"
    )
    assert not faults(tmp_path / "r")
    assert StoredRun(tmp_path / "r").config["machine"]["mass"] != 0.6
    assert not list((tmp_path / "r").glob(".*"))


def test_the_lock_ends_with_its_holder_and_a_waiting_process_gets_it(tmp_path):
    ready, go = os.pipe(), os.pipe()
    process = os.fork()
    if not process:
        with alone_in(tmp_path / "r", "key"):
            os.write(ready[1], b"x")
            os.read(go[0], 1)
            os._exit(0)  # without unlocking, as one that is killed
    os.read(ready[0], 1)
    with pytest.raises(BadInput, match=f"process {process} writes here"), alone_in(tmp_path / "r", "key"):
        pass
    os.write(go[1], b"x")
    with alone_in(tmp_path / "r", "key", wait=True):
        assert os.waitpid(process, 0)[1] == 0
    assert not list((tmp_path / "r").iterdir())


def test_two_sweeps_at_once_do_not_share_a_folder(tmp_path):
    (tmp_path / "s").mkdir()
    with alone_in(tmp_path / "s", "key"):
        done = cmacexp("-m", "seed=0,1", "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == (
            f"error: hydra.sweep.dir=s: process {os.getpid()} writes here; wait until it has ended, "
            "or choose another folder\n"
        )
        assert not [path for path in (tmp_path / "s").iterdir() if not path.name.startswith(".")]


def test_default_folders_of_sweeps_differ_within_a_second():
    from cmacexp.config import config_folder

    assert "%S-%f}" in next(
        line for line in (config_folder() / "config.yaml").read_text().splitlines() if "outputs/sweeps/" in line
    )


@pytest.mark.parametrize("name", ["metrics.csv", "trace.parquet", "recording.rrd"])
def test_a_file_of_the_user_is_not_replaced(name, tmp_path):
    (tmp_path / name).write_text("mine")
    with pytest.raises(BadInput, match=f"holds {name}, which is of no earlier result"):
        run(tmp_path)
    assert state_of(tmp_path) == {Path(name): b"mine"}


@pytest.mark.parametrize("text", ["{", '{"name": "app"}', "[1]"])
def test_another_manifest_is_not_replaced(text, tmp_path):
    (tmp_path / "manifest.json").write_text(text)
    for write in (run, lambda folder: write_report(Report("T", "S", [], []), folder)):
        with pytest.raises(BadInput, match=r"holds another manifest\.json") as caught:
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
    with pytest.raises(BadInput, match=r"holds the results of another program \(model\.pt\)"):
        run(tmp_path)
    (tmp_path / "model.pt").unlink()
    run(tmp_path)


def test_the_folder_of_a_run_killed_before_its_end_can_be_used(tmp_path):
    new = tmp_path / "r" / ".cmacexp-new"
    (new / ".hydra").mkdir(parents=True)
    (new / "trace.parquet").write_text("half")
    assert runs_below(tmp_path) == [tmp_path / "r"]
    assert faults(tmp_path / "r")
    run(tmp_path / "r")
    assert not faults(tmp_path / "r")
    assert not list((tmp_path / "r").glob(".*"))


def test_the_message_of_a_run_that_an_earlier_version_did_not_finish_says_how_to_go_on(first):
    (first / ".hydra").mkdir()
    (first / "manifest.json").unlink()
    before = state_of(first)
    with pytest.raises(BadInput) as raised:
        run(first)
    assert str(raised.value) == (
        f"hydra.run.dir={first}: holds trace.parquet but no manifest.json, as a run of an earlier version that was "
        "killed; move or delete that folder, then repeat the command"
    )
    assert state_of(first) == before


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
    with pytest.raises(BadInput, match=r"learning\.start_from=.*: is the folder of this run"):
        run_scenario(config, tmp_path / "w" / ".." / "w")
    assert state_of(tmp_path / "w") == before


def test_a_report_replaces_a_report_alone(first, tmp_path):
    before = state_of(first)
    with pytest.raises(BadInput, match=r"--out=.*: is the folder of a run"):
        write_report(Report("T", "S", [], []), first)
    assert state_of(first) == before
    write_report(Report("T", "S", [], []), tmp_path / "page")
    (tmp_path / "page" / "notes.txt").write_text("mine")
    write_report(Report("Second", "S", [], []), tmp_path / "page")
    assert "Second" in (tmp_path / "page" / "report.html").read_text()
    assert (tmp_path / "page" / "notes.txt").exists()
    with pytest.raises(BadInput, match="holds a report"):
        run(tmp_path / "page")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "report.html").write_text("mine")
    with pytest.raises(BadInput, match=r"holds report\.html"):
        write_report(Report("T", "S", [], []), tmp_path / "mine")


def test_a_report_does_not_replace_the_manifest_of_a_sweep(tmp_path):
    manifests.write(tmp_path, {"kind": manifests.SWEEP, "status": "completed", "config": {}, "files": {}})
    before = state_of(tmp_path)
    with pytest.raises(BadInput, match="is the folder of a sweep"):
        write_report(Report("", "", [], []), tmp_path)
    assert state_of(tmp_path) == before


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
    with pytest.raises(BadInput, match=f"holds another {name}"):
        check_tables(tmp_path)


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


def test_a_replacement_that_is_broken_off_is_finished_by_the_next_reader(first, monkeypatch):
    replace, moved = Path.replace, []

    def broken(self, target):
        if self.parent.name == ".cmacexp-new" and not self.name.startswith(".") and Path(target).parent == first:
            moved.append(target)
            if len(moved) == 2:
                raise KeyboardInterrupt
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", broken)
    with pytest.raises(KeyboardInterrupt):
        run(first, "machine.mass=0.6")
    assert not (first / "manifest.json").exists()
    assert StoredRun(first).config["machine"]["mass"] == 0.6
    assert not faults(first)
    assert not list(first.glob(".cmacexp*"))


@pytest.fixture
def small_disk(monkeypatch):
    """``small_disk(n)``: there is room for n parts of a trace."""

    def limit(parts):
        reserve, taken = TableWriter.reserve, []

        def refuse(self, part):
            taken.append(part)
            if len(taken) > parts:
                raise DiskFull("disk full: trace.parquet: cannot be written: no space left on device; make room")
            reserve(self, part)

        monkeypatch.setattr(TableWriter, "reserve", refuse)

    return limit


def test_a_long_result_keeps_what_found_room(small_disk, tmp_path, monkeypatch):
    monkeypatch.setattr("cmacexp.loop.run.MOST_ROWS", 400)
    whole = run(tmp_path / "whole", "cycles=6")
    small_disk(2)
    cut = run(tmp_path / "cut", "cycles=6")
    assert cut.status == "failed"
    assert cut.manifest["cause"].startswith("after step 800: disk full: trace.parquet")
    assert cut.manifest["steps"] == len(cut.trace) == 800
    assert cut.trace.equals(whole.trace[:800])
    assert cut.metrics["cycle"].tolist() == [1, 2, 3, 4]
    assert cut.metrics.equals(whole.metrics[:4])
    assert not faults(tmp_path / "cut")


def test_a_full_disk_keeps_an_earlier_run_instead(small_disk, first):
    before = state_of(first)
    small_disk(0)
    with pytest.raises(DiskFull, match=r"disk full: trace\.parquet"):
        run(first, "machine.mass=0.6")
    assert state_of(first) == before


def test_what_a_part_needs_is_reserved(tmp_path, monkeypatch):
    close, sizes = TableWriter.close, []

    def measure(self):
        reserved = self._temporary.stat().st_size
        close(self)
        sizes.append((reserved, self._temporary.stat().st_size))

    monkeypatch.setattr(TableWriter, "close", measure)
    monkeypatch.setattr("cmacexp.loop.run.MOST_ROWS", 400)
    run(tmp_path / "r", "cycles=6")
    reserved, size = sizes[0]
    assert size <= reserved <= 4 * size


def test_score_replaces_all_metrics_or_none(first, monkeypatch):
    from cmacexp.commands.score import score

    (first / ".metrics.csv.1.part").write_text("left by one that was killed")
    listed = manifests.read(first)
    score(first)
    assert manifests.read(first) == listed
    before = state_of(first)
    assert not list(first.glob(".*"))

    def refuse(folder):
        raise OSError("refused")

    with monkeypatch.context() as patch:
        patch.setattr(staging, "_replace", refuse)
        with pytest.raises(OSError, match="refused"):
            score(first)
    assert {path: text for path, text in state_of(first).items() if ".cmacexp-new" not in path.parts} == before
    with run_place(first):
        pass  # brings it to its end
    assert not faults(first)


COMMANDS = {
    "run": ([23, 68], ["cmacexp.commands.main", *JOB, "machine.mass=0.6", "hydra.run.dir=r"]),
    "sweep": ([120], ["cmacexp.commands.main", "-m", *JOB, "machine.mass=0.6", "seed=0,1", "hydra.sweep.dir=s"]),
    "score": ([9], ["cmacexp.score", "r"]),
    "report": ([], ["cmacexp.commands.report", "r"]),
}
"""Commands, and the writes of each that fail in the short form of the test."""


@pytest.mark.parametrize("name", COMMANDS)
def test_any_write_may_fail(name, tmp_path):
    """A sample of the writes; all of them with ``CMACEXP_ALL_WRITES=1``."""
    sample, words = COMMANDS[name]
    folder = tmp_path / "work"
    run(folder / "s" / "0" if name == "sweep" else folder / "r")
    if name == "report":
        write_report(Report("T", "S", [], []), folder / "r" / "report")
    if os.environ.get(ALL_WRITES):
        assert fail(count(1), True, folder, words) > 10
    elif sample:
        assert fail(sample, False, folder, words) == len(sample)


def test_the_manifest_of_a_run_lists_what_it_wrote(first):
    assert json.loads((first / "manifest.json").read_text())["files"].keys() == {
        path.name for path in first.iterdir() if path.name != "manifest.json"
    }
