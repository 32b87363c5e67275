"""The tables of a sweep, and the parts of them while it runs: none that has changed or is of another form is read."""

import random
import shutil
from subprocess import CompletedProcess

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.command import call, sweep
from support.damage import BAD_TEXTS, flip
from support.doors import BadInput, BadRun, collection, read_table, sha256
from support.manifests import change_manifest

from cmacexp import load_sweep
from cmacexp.engine.job_store import JobTables, list_jobs, write_part

JOBS = ("scenario=force_step", "gait.cycle_time=0.5", "cycles=1", "seed=0,1", "hydra/launcher=basic")
RUNS, METRICS, TABLE = "runs.parquet", "metrics.parquet", "sweep.parquet"


@pytest.fixture(scope="module", params=["metrics", "trace"])
def made(request, tmp_path_factory):
    """The folder of a sweep of two jobs, without folders or with."""
    folder = tmp_path_factory.mktemp("made")
    assert sweep(*JOBS, f"record={request.param}", folder=folder).returncode == 0
    return folder / "s"


@pytest.fixture
def swept(made, tmp_path):
    return shutil.copytree(made, tmp_path / "s")


def assert_refused(folder, read):
    """``read`` raises one line, or prints it and ends with a code of its own."""
    try:
        done = read(folder)
    except BadRun as error:
        done = CompletedProcess([], 2, "", str(error))
    assert done.returncode in (2, 4), done.stdout
    assert len(done.stderr.splitlines()) <= 1


READERS = {
    "verify": lambda folder: call("verify", folder),
    "report": lambda folder: call("report", folder),
    "load_sweep": load_sweep,
}


@pytest.mark.parametrize("name", [RUNS, METRICS, TABLE])
def test_a_changed_table_of_a_sweep_is_found(name, swept):
    content, chance = (swept / name).read_bytes(), random.Random(name)
    readers = [READERS["verify"]] if name == TABLE else READERS.values()  # nobody reads that one
    for _ in range(10):
        flip(swept / name, chance)
        for read in readers:
            assert_refused(swept, read)
        (swept / name).write_bytes(content)
    assert call("verify", swept).returncode == 0


def as_if_it_runs(folder):
    """Give the folder of a sweep the state of one that was killed before it wrote its tables."""
    tables = JobTables(*(read_table(folder / name, texts=True) for name in (RUNS, METRICS)))
    write_part(folder, "0" * 8, tables)
    for name in (RUNS, METRICS, TABLE):
        (folder / name).unlink()
    change_manifest(folder, status="unfinished", files={})
    return next((folder / ".jobs").iterdir())


def test_a_changed_part_of_a_sweep_that_was_killed_is_found_and_its_jobs_run_again(swept):
    before, part = load_sweep(swept), as_if_it_runs(swept)
    assert load_sweep(swept)[list(before.columns)].equals(before)
    content, chance = part.read_bytes(), random.Random(0)
    for _ in range(10):
        flip(part, chance)
        for read in READERS.values():
            assert_refused(swept, read)
        part.write_bytes(content)
    flip(part, chance)
    record = "trace" if (swept / "0").exists() else "metrics"
    again = sweep(*JOBS, f"record={record}", "sweep.resume=true", folder=swept.parent)
    assert again.returncode == 0
    assert f"warning: {part.relative_to(swept.parent)}" in again.stderr.replace("\n", "")
    assert load_sweep(swept).equals(before)


def change(name, values):
    """Return what changes a column of a table, by its values now."""
    return lambda table: table.set_column(table.schema.get_field_index(name), name, values(table[name]))


def texts(text):
    return lambda column: pa.array([text] * len(column))


HOSTILE = {
    "manifests of no JSON": (RUNS, change("manifest", texts("{"))),
    "manifests of another form": (RUNS, change("manifest", texts("[]"))),
    "manifests without end": (RUNS, change("manifest", texts("[" * 100_000))),
    "manifests of a report": (RUNS, change("manifest", texts('{"kind": "report", "status": "completed"}'))),
    "texts that are none": (RUNS, change("folder", lambda column: BAD_TEXTS)),
    "a folder above": (RUNS, change("folder", texts("../other"))),
    "a folder elsewhere": (RUNS, change("folder", texts("/etc"))),
    "folders that lack": (RUNS, change("folder", lambda column: pa.nulls(len(column), pa.string()))),
    "another status": (RUNS, change("status", texts("fine"))),
    "the status of no manifest": (RUNS, change("status", texts("fell"))),
    "numbers as texts": (RUNS, change("run", texts("0"))),
    "a number twice": (RUNS, change("run", lambda column: pa.array([0] * len(column)))),
    "no status": (RUNS, lambda table: table.drop_columns("status")),
    "metrics of no job": (METRICS, change("run", lambda column: pa.array([7] * len(column)))),
    "metrics of texts": (METRICS, change("cycle", texts("1"))),
    "no cycle": (METRICS, lambda table: table.drop_columns("cycle")),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_table_of_a_sweep_whose_hash_fits_but_of_another_form_is_refused_in_one_line(name, swept):
    file, damage = HOSTILE[name]
    pq.write_table(damage(pq.read_table(swept / file)), swept / file)
    for job in swept.glob("[01]"):
        shutil.rmtree(job)  # else they are the truth
    change_manifest(swept, files={each: sha256(swept / each) for each in (RUNS, METRICS)})
    assert_refused(swept, READERS["report"])
    if not name.startswith(("manifests", "the status")):  # which it does not read
        assert_refused(swept, load_sweep)


def test_a_second_sweep_in_a_folder_is_refused_while_the_first_one_runs(swept):
    with (
        collection(swept, "hydra.sweep.dir"),
        pytest.raises(BadInput, match="another sweep runs there"),
        collection(swept, "hydra.sweep.dir"),
    ):
        pass
    with collection(swept, "hydra.sweep.dir"):
        pass
    assert not list(swept.glob(".cmacexp*"))


@pytest.mark.parametrize("name", [RUNS, "multirun.yaml", "optimization_results.yaml", ".jobs"])
def test_a_sweep_refuses_a_folder_with_files_of_others_that_it_would_replace(name, tmp_path):
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / name).write_text("mine")
    done = sweep(*JOBS, folder=tmp_path)
    assert (done.returncode, [path.name for path in (tmp_path / "s").iterdir()]) == (2, [name])
    assert name in done.stderr


def test_jobs_leave_folders_of_earlier_jobs_and_of_others_alone(made, swept):
    (swept / "0").mkdir(exist_ok=True)
    for name in (".notes", "my.log"):
        (swept / "0" / name).write_text("mine")
    before = {path.name: path.read_bytes() for path in (swept / "0").iterdir() if path.is_file()}
    done = sweep(*JOBS, "record=metrics", folder=swept.parent)
    assert done.returncode == 0
    assert {path.name: path.read_bytes() for path in (swept / "0").iterdir() if path.is_file()} == before
    assert [job.status for job in list_jobs(swept)] == ["completed"] * 2


def test_a_sweep_that_is_interrupted_keeps_the_tables_of_one_that_was_not(swept, monkeypatch):
    before = {name: (swept / name).read_bytes() for name in (RUNS, METRICS, TABLE, "manifest.json")}
    monkeypatch.setattr("cmacexp.engine.job.JobRunner.run_item", interrupt_from(1))
    done = sweep(*JOBS, "cycles=2", "record=metrics", folder=swept.parent)
    assert done.returncode == 130
    assert "keeps the tables of its earlier sweep" in done.stderr
    assert {name: (swept / name).read_bytes() for name in before} == before
    monkeypatch.undo()
    more = sweep(*JOBS, "cycles=2", "record=metrics", "sweep.resume=true", folder=swept.parent)
    assert more.stdout.count("finished before, not run again") == 1
    assert load_sweep(swept)["cycle"].tolist() == [1, 2] * 2


def interrupt_from(number):
    """Run jobs up to one, and raise an interrupt there."""
    from cmacexp.engine.job import JobRunner

    original = JobRunner.run_item

    def run_item(runner, template, root, item, *rest):
        if item.number == number:
            raise KeyboardInterrupt
        return original(runner, template, root, item, *rest)

    return run_item
