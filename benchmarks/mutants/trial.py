"""One mutant: the tests that it has to pass, and how they run with it."""

import gc
import importlib.util
import sys
from collections.abc import Iterator
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

from benchmarks.mutants.mutations import Mutant
from benchmarks.mutants.session import OPTIONS, ROOT, Collected, run_until_failure

FIGURES = ("tests/laws/test_golden.py", "tests/laws/test_bits.py")
"""Figures of an earlier version: they find almost every fault and explain none, so they run last."""
BUDGET = 30.0
"""Time of the tests of a mutant, s, but the figures: the quickest that fit are run."""
KILLED, SURVIVED, FIGURES_ONLY, INVALID = "killed", "survived", "killed by figures only", "invalid"
CANNOT_START = "cannot be imported"
NO_END = "no end"


def codes(code: CodeType) -> Iterator[CodeType]:
    """A piece of code and all within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes(constant)


def run_replaced(mutant: Mutant, items: list[pytest.Item]) -> str:
    """Replace the code of the functions that hold the fault, and run the tests."""
    path, source = str(ROOT / mutant.path), (ROOT / mutant.path).read_bytes()
    before, after = (codes(compile(text, path, "exec")) for text in (source, mutant.apply(source)))
    changed = {old: new for old, new in zip(before, after, strict=True) if old != new}
    functions = [found for found in gc.get_objects() if isinstance(found, FunctionType)]
    for function in functions:
        if function.__code__.co_filename == path and function.__code__ in changed:
            function.__code__ = changed[function.__code__]
    return run_until_failure(items)


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


def run_imported(mutant: Mutant, tests: list[str]) -> str:
    """Import the project with the fault, and run the tests."""
    try:
        importlib.import_module(Mutated.install(mutant))
    except BaseException:
        return CANNOT_START
    failed = []

    def run(items: dict[str, pytest.Item]) -> None:
        failed.append(run_until_failure([items[test] for test in tests if test in items]))

    files = dict.fromkeys(test.partition("::")[0] for test in tests)
    code = pytest.main([*OPTIONS, *files], plugins=[Collected(run)])
    return failed[0] if failed else f"pytest ends with {code}"


@cache
def read_source(file: str) -> str:
    """The text of a file of tests; nothing if there is none."""
    path = ROOT / file
    return path.read_text() if path.exists() else ""


def is_early(mutant: Mutant, record: dict[str, Any]) -> bool:
    """Whether code that holds the fault runs while the project is imported."""
    return not mutant.function or [mutant.path.removeprefix("cmacexp/"), mutant.function] in record["early"]


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
    early = is_early(mutant, record)
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
