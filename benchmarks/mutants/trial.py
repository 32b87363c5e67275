"""One mutant: the tests that it has to pass, and how they run with it."""

import importlib.util
import sys
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import Any

from benchmarks.mutants.mutations import Mutant
from benchmarks.mutants.session import ROOT, run_until_failure

FIGURES = ("tests/laws/test_golden.py", "tests/laws/test_bits.py")
"""Figures of an earlier version: they find almost every fault and explain none, so they run last."""
BUDGET = 30.0
"""Time of the tests of a mutant, s, but the figures: the quickest that fit are run."""
KILLED, SURVIVED, FIGURES_ONLY, INVALID = "killed", "survived", "killed by figures only", "invalid"
CANNOT_START = "cannot be imported"
NO_END = "no end"


class Mutated(SourceFileLoader):
    """Imports a file with a fault."""

    def __init__(self, name: str, mutant: Mutant):
        super().__init__(name, str(ROOT / mutant.path))
        self.mutant = mutant

    @classmethod
    def install(cls, mutant: Mutant) -> str:
        """Have the module of ``mutant`` imported with its fault; the name of the module."""
        module = mutant.path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        sys.meta_path.insert(0, cls(module, mutant))
        return module

    def find_spec(self, name, path=None, target=None):
        return importlib.util.spec_from_loader(name, self) if name == self.name else None

    def get_code(self, fullname):
        return compile(self.mutant.apply(Path(self.path).read_bytes()), self.path, "exec")


def run_imported(mutant: Mutant, tests: list[str], tier: str) -> str:
    """Import the project with the fault, and run the tests."""
    try:
        importlib.import_module(Mutated.install(mutant))
    except BaseException:
        return CANNOT_START
    return run_until_failure(tests, tier)


@cache
def read_source(file: str) -> str:
    """The text of a file of tests; nothing if there is none."""
    path = ROOT / file
    return path.read_text() if path.exists() else ""


def choose_tests(mutant: Mutant, record: dict[str, Any]) -> list[str]:
    """Tests that call the function of the mutant, as many of the quickest as fit, those of the quickest file first.

    A mutant outside of functions has the tests of files that import its file, and those that call a function of it;
    one in a function that runs while the project is imported has the former too.
    """
    name = mutant.path.removeprefix("cmacexp/")
    module = mutant.path.removesuffix(".py").replace("/", ".")

    def calls(test: str) -> bool:
        called = record["calls"].get(test, ())
        if mutant.function:
            return [name, mutant.function] in called
        return any(path == name for path, _ in called)

    seconds: dict[str, float] = record["seconds"]
    files = dict.fromkeys(test.partition("::")[0] for test in seconds)
    early = not mutant.function or [name, mutant.function] in record["early"]
    importing = {file for file in files if early and f"from {module} import" in read_source(file)}
    calling = [
        test for test in seconds if (file := test.partition("::")[0]) in importing or calls(test) or calls(file)
    ]
    chosen: dict[str, list[str]] = {}
    spent = 0.0
    for test in sorted(calling, key=lambda test: (test.partition("::")[0] not in importing, seconds[test])):
        file = test.partition("::")[0]
        if file in FIGURES or spent + seconds[test] < BUDGET:
            spent += seconds[test]
            chosen.setdefault(file, []).append(test)
    files = sorted(chosen, key=lambda file: (file in FIGURES, sum(seconds[test] for test in chosen[file])))
    return [test for file in files for test in chosen[file]]


def judge(mutant: Mutant, tests: list[str], failed: str | None) -> dict[str, Any]:
    """The result of a mutant; ``failed`` is the test that found it, nothing, or None if the tests did not end."""
    match failed:
        case "":
            result = SURVIVED
        case _ if failed == CANNOT_START:
            result = INVALID
        case str() if failed.startswith(FIGURES):
            result = FIGURES_ONLY
        case _:
            result = KILLED
    return {"mutant": list(mutant), "result": result, "by": NO_END if failed is None else failed, "tests": len(tests)}
