"""``python -m tests.mutants``: whether the tests find small faults in the mathematics.

Each fault is made in a copy of the project. The tests that call the function which holds it run, without compiled
code, until one fails.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from tests.mutants.mutations import Mutant, find_mutants, sample
from tests.mutants.page import write_page
from tests.mutants.trial import SURVIVED, Copy, try_mutant, warm_up

ROOT = Path(__file__).parents[2]
ROOMS = ("models", "cmac", "planning", "feedforward", "control", "metrics")
FILES = ("plants/kernels.py", "sensors/kernels.py", "loop/step.py", "loop/stop.py")
"""The mathematics: rooms and files of the package."""
TESTS = ("tests/laws", "tests/components")
"""What calls it in the process of the test."""
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


def make_copy(folder: Path) -> Path:
    """Copy the project, with compiled files that are checked by the hash of their source, not by its time."""
    ignored = shutil.ignore_patterns("__pycache__", "outputs", ".git", ".venv", ".hypothesis", ".*_cache")
    shutil.copytree(ROOT, folder, ignore=ignored)
    compiling = [sys.executable, "-m", "compileall", "-q", "--invalidation-mode", "checked-hash", "cmacexp"]
    subprocess.run(compiling, cwd=folder, check=True)
    return folder


def record_calls(copy: Path, out: Path) -> dict[str, Any]:
    """Run the tests once without a fault; what :mod:`tests.mutants.calls` records of those that pass."""
    if not out.exists():
        command = [sys.executable, "tests/mutants/calls.py", "cmacexp", str(out), *TESTS]
        subprocess.run(command, cwd=copy, check=True, env={**os.environ, "PYTHONPATH": str(copy)})
    return json.loads(out.read_text())


def read_results(log: Path) -> dict[Mutant, dict[str, Any]]:
    """The last result of each mutant that was tried."""
    lines = log.read_text().splitlines() if log.exists() else []
    return {Mutant(*result["mutant"]): result for result in map(json.loads, lines)}


def try_mutants(todo: list[Mutant], folder: Path, log: Path, workers: int) -> None:
    """Try mutants, some at the same time, and log each result at once."""
    warm_up()
    with tempfile.TemporaryDirectory(prefix="mutants-") as copies:
        free = get_context("fork").Queue()
        projects = [make_copy(Path(copies) / str(number)) for number in range(workers)]
        record = record_calls(projects[0], folder / "calls.json")
        for project in projects:
            free.put(project)
        with ProcessPoolExecutor(workers, get_context("fork"), Copy.take, (free,)) as pool:
            for number, result in enumerate(pool.map(partial(try_mutant, record), todo), 1):
                with log.open("a") as file:
                    file.write(json.dumps(result) + "\n")
                print(f"{number}/{len(todo)} {result['result']} {Mutant(*result['mutant'])}", flush=True)


def main() -> None:
    """Try a sample of mutants, and write the results into a page if asked to."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--number", type=int, default=300, help="mutants, and a few more for small files")
    parser.add_argument("--seed", type=int, default=1997, help="of the sample")
    parser.add_argument("--workers", type=int, default=1, help="mutants tried at the same time")
    parser.add_argument("--folder", type=Path, help="keeps results: of those in it only survivors are tried again")
    parser.add_argument("--results-only", action="store_true", help="try nothing: only write the page")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="replace the results between the page's markers")
    chosen = parser.parse_args()
    folder = chosen.folder or Path(tempfile.mkdtemp(prefix="mutants-"))
    folder.mkdir(parents=True, exist_ok=True)
    log, mutants = folder / "results.jsonl", all_mutants()
    sampled = sample(mutants, chosen.number, LEAST, chosen.seed)
    known = read_results(log)
    todo = [mutant for mutant in sampled if mutant not in known or known[mutant]["result"] == SURVIVED]
    if not chosen.results_only:
        try_mutants(todo, folder, log, chosen.workers)
    known = read_results(log)
    if chosen.write:
        results = [known[mutant] for mutant in sampled if mutant in known]
        write_page(chosen.write, results, sum(map(len, mutants.values())), chosen.seed)


if __name__ == "__main__":
    main()
