"""``python -m benchmarks.mutants``: whether the tests find small faults in the mathematics.

Each fault is made in a copy of the project. The tests that call the function which holds it run, without compiled
code, until one fails.
"""

import argparse
import importlib
import importlib.util
import json
import os
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.mutants.mutations import Mutant, find_mutants, sample
from benchmarks.mutants.page import write_page
from benchmarks.mutants.session import ROOT, TIERS, call_apart, record_calls
from benchmarks.mutants.trial import SURVIVED, choose_tests, judge, run_imported

ROOMS = ("models", "cmac", "planning", "feedforward", "control", "metrics")
FILES = ("plants/kernels.py", "sensors/kernels.py", "loop/step.py", "loop/stop.py")
"""The mathematics: rooms and files of the package."""
WARM = (
    "numpy", "numpy.polynomial", "scipy.linalg", "scipy.signal", "scipy.optimize", "scipy.spatial", "scipy.stats",
    "pandas", "pyarrow.parquet", "numba", "hydra", "hypothesis", "yaml", "sklearn.neural_network",
)  # fmt: skip
"""Libraries that are imported once for all mutants."""
OPTIONAL = ("mujoco",)
"""The same of an extra; it asks another process for a library while it is imported, which no test of a mutant may."""
MOST_TIME = 120
"""A mutant whose tests compute for longer, s, has no end: it is killed."""
LEAST = 3
"""Mutants of each file that has so many."""


def all_mutants() -> dict[str, list[Mutant]]:
    """Mutants by file, as a path from the root."""
    package = ROOT / "cmacexp"
    paths = [path for room in ROOMS for path in sorted((package / room).glob("*.py"))]
    found = {}
    for path in (*paths, *map(package.joinpath, FILES)):
        name = str(path.relative_to(ROOT))
        found[name] = find_mutants(name, path.read_text())
    return {path: mutants for path, mutants in found.items() if mutants}


def warm_up() -> None:
    """Import libraries, but nothing of the project, before processes are forked."""
    os.environ.update(NUMBA_DISABLE_JIT="1", PYTHONDONTWRITEBYTECODE="1", PYTHONPATH=str(ROOT))
    os.chdir(ROOT)
    for name in (*WARM, *filter(importlib.util.find_spec, OPTIONAL)):
        importlib.import_module(name)
    if "cmacexp" in sys.modules:
        raise RuntimeError("the project is imported already: its mutants would not be")


def read_calls(recorded: Path, tier: str, workers: int) -> dict[str, Any]:
    """What the tests of a tier call, from a file; made first if there is none."""
    if not recorded.exists():
        with ProcessPoolExecutor(workers, get_context("fork")) as pool:
            found = list(pool.map(partial(call_apart, record_calls, tier), range(workers), repeat(workers)))
        seconds, calls = (
            {test: value for part in found for test, value in part[of].items()} for of in ("seconds", "calls")
        )
        recorded.write_text(json.dumps({"seconds": seconds, "calls": calls, "early": found[0]["early"]}))
    return json.loads(recorded.read_text())


def read_results(log: Path) -> dict[Mutant, dict[str, Any]]:
    """The last result of each mutant that was tried."""
    lines = log.read_text().splitlines() if log.exists() else []
    return {Mutant(*result["mutant"]): result for result in map(json.loads, lines)}


def share_out(work: Callable[[Mutant], dict[str, Any]], mutants: list[Mutant], log: Path, workers: int) -> None:
    """Do ``work`` for each mutant in as many processes as there are workers, and log each result at once."""

    def do(own: list[Mutant]) -> None:
        for mutant in own:
            result = work(mutant)
            with log.open("a") as file:
                file.write(json.dumps(result) + "\n")
            print(f"{result['result']}: {mutant.path}:{mutant.line} {mutant.old} -> {mutant.new}", flush=True)

    processes = [get_context("fork").Process(target=do, args=(mutants[n::workers],)) for n in range(workers)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    if any(process.exitcode for process in processes):
        raise RuntimeError("a process has failed")


def try_mutants(todo: list[Mutant], tier: str, folder: Path, log: Path, workers: int) -> None:
    """Try mutants against the tests of a tier, each in a process of its own, which imports the project with it."""
    warm_up()
    record = read_calls(folder / f"calls-{tier}.json", tier, workers)

    def try_one(mutant: Mutant) -> dict[str, Any]:
        tests = choose_tests(mutant, record)
        failed = call_apart(run_imported, mutant, tests, tier, most=MOST_TIME)
        return judge(mutant, tests, failed) | {"tier": tier}

    share_out(try_one, todo, log, workers)


def main() -> None:
    """Try a sample of mutants, and write the results into a file if asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("--number", type=int, default=300, help="mutants, and a few more for small files")
    parser.add_argument("--seed", type=int, default=1997, help="of the sample")
    parser.add_argument("--workers", type=int, default=1, help="mutants tried at the same time")
    parser.add_argument("--tier", choices=TIERS, default="first", help="tests that have to find them: of which tier")
    parser.add_argument("--folder", type=Path, help="keeps results: of those in it only survivors are tried again")
    parser.add_argument("--results-only", action="store_true", help="try nothing: only write the file")
    parser.add_argument("--write", type=Path, metavar="FILE", help="keep the tables in this file")
    chosen = parser.parse_args()
    folder = chosen.folder or Path(tempfile.mkdtemp(prefix="mutants-"))
    folder.mkdir(parents=True, exist_ok=True)
    log, mutants = folder / "results.jsonl", all_mutants()
    sampled = sample(mutants, chosen.number, LEAST, chosen.seed)
    known = read_results(log)
    todo = [mutant for mutant in sampled if mutant not in known or known[mutant]["result"] == SURVIVED]
    if not chosen.results_only:
        try_mutants(todo, chosen.tier, folder, log, chosen.workers)
    known = read_results(log)
    if chosen.write:
        results = [known[mutant] for mutant in sampled if mutant in known]
        write_page(chosen.write, results, sum(map(len, mutants.values())), chosen.seed)


if __name__ == "__main__":
    main()
