"""The driver of many runs on other executors: threads, Dask, the one process of a worker."""

import multiprocessing
import os
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from itertools import count

import pandas as pd
import pytest
from support.command import python

from cmacexp import run_many, write_many
from cmacexp.engine import workers
from cmacexp.engine.driver import map_runs
from cmacexp.engine.launcher import TaskLauncher, Work
from cmacexp.engine.workers import Here, count_processes
from cmacexp.errors import BadInput

SHORT = ("scenario=one_leg", "gait.cycle_time=0.5", "gait.stroke=0.02", "cycles=2", "warn=false")
RUNS = [[*SHORT, f"seed={seed}", *rate] for seed in range(6) for rate in ([], ["learning.rate=0.1"])]


def write(folder, name, **options):
    """The bytes of the file of these runs."""
    write_many(folder / name, RUNS, **options)
    return (folder / name).read_bytes()


def test_runs_in_threads_and_in_this_process_give_the_same_bytes(tmp_path):
    here = write(tmp_path, "here", processes=1)
    with ThreadPoolExecutor(4) as threads:
        for repetition in range(3):
            assert write(tmp_path, f"threads{repetition}", executor=threads) == here


@pytest.mark.ci
def test_processes_and_dask_give_the_same_bytes(tmp_path):
    here = write(tmp_path, "here", processes=1)
    assert write(tmp_path, "own", processes=2) == here
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as spawned:
        assert write(tmp_path, "spawned", executor=spawned) == here
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster) as client,
    ):
        assert write(tmp_path, "dask", executor=client.get_executor()) == here


def test_a_generator_is_drawn_as_it_runs_and_numbers_go_on(tmp_path):
    write_many(tmp_path / "some.parquet", (run for run in RUNS), processes=1, first=7)
    table = pd.read_parquet(tmp_path / "some.parquet")
    assert sorted(table["run"].unique()) == [*range(7, 7 + len(RUNS))]
    pd.testing.assert_frame_equal(table.drop(columns="run"), run_many(RUNS, processes=1).drop(columns="run"))


def test_what_waits_is_bounded_and_cancelled_when_the_caller_stops():
    class Waiting(Here):
        """Holds calls until it is asked for them."""

        def __init__(self):
            self.futures = []

        def submit(self, fn, /, *args, **kwargs):
            self.futures.append(Future())
            if len(self.futures) == 3:
                self.futures[0].set_result("done")
            return self.futures[-1]

    executor, items = Waiting(), ((number,) for number in count())
    results = map_runs(abs, items, executor, ahead=3)
    assert next(results) == (0, "done")
    results.close()
    assert [future.cancelled() for future in executor.futures] == [False, True, True]
    assert next(items) == (3,)


def test_a_lost_task_ends_the_work_unless_somebody_takes_that():
    def lose(number):
        if number == 1:
            raise ChildProcessError("lost")
        return number

    lost = []
    assert dict(map_runs(lose, [(0,), (1,), (2,)], Here(), on_lost=lost.append)) == {0: 0, 2: 2}
    assert lost == ["lost"]
    with pytest.raises(ChildProcessError, match="lost"):
        list(map_runs(lose, [(0,), (1,)], Here()))


@pytest.mark.parametrize(
    ("options", "seconds", "sizes"),
    [
        ({"tasks": 3}, 1.0, [4, 3, 3]),
        ({"chunk": 5}, 1.0, [5, 5]),
        ({}, 1.0, [10]),
        ({}, 240.0, [3, 3, 2, 2]),
        ({}, 1e9, [1] * 10),
    ],
)
def test_shares_of_tasks_follow_from_what_is_asked_for_or_the_work(options, seconds, sizes):
    work = Work(abs, [(number,) for number in range(10)], seconds=seconds)
    assert [len(share) for share in TaskLauncher(Here(), **options).split(work)] == sizes


def test_a_chunk_that_makes_too_many_tasks_is_refused():
    work = Work(abs, [(number,) for number in range(2_000)])
    with pytest.raises(BadInput, match=r"sweep.chunk=1: makes 2000 tasks of 2000 jobs; give at least 3"):
        TaskLauncher(Here(), chunk=1).split(work)


POOL = """
import multiprocessing
import cmacexp

def count(seed):
    return len(cmacexp.run_many([["cycles=1", f"seed={seed}"]] * 2))

if __name__ == "__main__":
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        print(pool.map(count, [1]))
"""


@pytest.mark.ci
def test_a_worker_of_a_pool_runs_many_in_its_own_process(tmp_path):
    (tmp_path / "pool.py").write_text(POOL)
    done = python("pool.py", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "[2]\n"), done.stderr


@pytest.mark.parametrize(
    ("group", "files", "expected"),
    [
        ("0::/", {"cpu.max": "200000 100000"}, 2),
        ("0::/", {"cpu.max": "250000 100000"}, 3),
        ("0::/", {"cpu.max": "max 100000"}, 8),
        ("0::/a/b", {"a/b/cpu.max": "400000 100000", "a/cpu.max": "10000 100000"}, 1),
        ("0::/docker/of_the_host", {"cpu.max": "300000 100000"}, 3),
        (
            "4:cpu,cpuacct:/a",
            {"cpu,cpuacct/a/cpu.cfs_quota_us": "600000", "cpu,cpuacct/a/cpu.cfs_period_us": "100000"},
            6,
        ),
        ("4:cpu:/", {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, 8),
        ("9:name=systemd:/", {}, 8),
    ],
)
def test_a_quota_of_processor_time_limits_the_processes(group, files, expected, tmp_path, monkeypatch):
    (tmp_path / "groups").write_text(f"7:memory:/x\n{group}\n")
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{text}\n")
    monkeypatch.setattr(workers, "CONTROL", tmp_path)
    monkeypatch.setattr(workers, "GROUPS", tmp_path / "groups")
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: range(8))
    monkeypatch.delenv("SLURM_CPUS_PER_TASK", raising=False)
    assert count_processes(None) == expected
    assert count_processes(5) == 5
