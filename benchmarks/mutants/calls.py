"""Which functions of the package each test calls, and how long it takes.

The package is imported so that each of its functions reports that it is called: this takes less than tracing. What a
test calls in its call belongs to it alone. What runs in its set-up may serve the other tests of the file too and
belongs to all of them.
"""

import ast
import builtins
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import PathFinder, SourceFileLoader
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

import pytest
from hypothesis import Phase, settings

LONGEST = 4
"""Tests that take longer, s, are too slow to run against every mutant."""
EXAMPLES = 8
REPORT = "__report_call__"


class Unfit(BaseException):
    """A test does not suit; no test and no shrinking of examples catches it."""


def refuse(event, arguments):
    """Stop a test that starts another process, whose calls are not seen; git, asked for the commit, calls nothing."""
    if event == "subprocess.Popen" and arguments[0] != "git":
        raise Unfit


def refuse_workers():
    """Stop a test that starts worker processes, likewise."""
    raise Unfit


def stop(*_):
    """Stop the test that runs."""
    raise Unfit


@contextmanager
def limit(seconds: float) -> Iterator[None]:
    """Stop what computes for longer; time in which others use the processor does not count."""
    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def take_few_examples() -> None:
    """Let tests with examples of hypothesis try few, and not look for the simplest that fails."""
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutants", settings.get_profile("laws"), max_examples=EXAMPLES, phases=phases)
    settings.load_profile("mutants")


class Reporting(ast.NodeTransformer):
    """Lets every function of a file report that file and its first line, as a mutant has them."""

    def __init__(self, file: str):
        self.file = file

    def _report(self, line: int) -> ast.Call:
        return ast.Call(ast.Name(REPORT, ast.Load()), [ast.Constant((self.file, line))], [])

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Report first, after the docstring."""
        self.generic_visit(node)
        first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
        node.body.insert(ast.get_docstring(node) is not None, ast.Expr(self._report(first)))
        return node

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        """Report, which is false, or compute."""
        self.generic_visit(node)
        node.body = ast.BoolOp(ast.Or(), [self._report(node.lineno), node.body])
        return node


class ReportingLoader(SourceFileLoader):
    """Imports a file of the package whose functions report their calls."""

    package = Path()

    def get_code(self, fullname):
        tree = Reporting(str(Path(self.path).relative_to(self.package))).visit(
            ast.parse(Path(self.path).read_bytes())
        )
        return compile(ast.fix_missing_locations(tree), self.path, "exec")


class ReportingFinder(MetaPathFinder):
    """Finds the package for :class:`ReportingLoader`."""

    def find_spec(self, fullname, path=None, target=None):
        if fullname.partition(".")[0] != ReportingLoader.package.name:
            return None
        spec = PathFinder.find_spec(fullname, path)
        if spec and isinstance(spec.loader, SourceFileLoader):
            spec.loader = ReportingLoader(fullname, spec.loader.path)
        return spec


class Calls:
    """A plugin of pytest that records the calls of functions of files in the folder ``package``.

    It runs one in so many ``parts`` of the test files. The package must not be imported yet.
    """

    def __init__(self, package: Path, part: int, parts: int):
        self.prefix, self.now = str(package), ""
        self.part, self.parts = part, parts
        self.called: dict[str, set[tuple[str, int]]] = defaultdict(set)
        self.early: set[tuple[str, int]] = set()
        """Called while a file of the package is imported."""
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        ReportingLoader.package = package
        sys.meta_path.insert(0, ReportingFinder())
        setattr(builtins, REPORT, self.report)

    def report(self, function: tuple[str, int]) -> None:
        """Note that a function is called."""
        self.called[self.now].add(function)
        if not self.now:
            frame = sys._getframe(1)
            while frame := frame.f_back:  # type: ignore[assignment]
                if frame.f_code.co_name == "<module>" and frame.f_code.co_filename.startswith(self.prefix):
                    self.early.add(function)

    def pytest_configure(self):
        take_few_examples()

    def pytest_collection_modifyitems(self, items):
        files = list(dict.fromkeys(item.path for item in items))[self.part :: self.parts]
        items[:] = [item for item in items if item.path in files]
        sys.addaudithook(refuse)
        forkserver.ensure_running = refuse_workers  # which no audit hook sees

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self, item):
        self.now = item.nodeid.partition("::")[0]
        with limit(4 * LONGEST):  # it may serve many tests
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        self.now = item.nodeid
        with limit(LONGEST):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        start = time.process_time()
        result = yield
        self.seconds[item.nodeid] = time.process_time() - start
        return result

    def pytest_runtest_logreport(self, report):
        if not report.passed:
            self.failed.add(report.nodeid)

    @property
    def record(self) -> dict[str, Any]:
        """Of the tests that passed, by name: seconds. Of them and their files: calls. And the early calls."""
        seconds = {test: time for test, time in self.seconds.items() if test not in self.failed}
        calls = {test: sorted(called) for test, called in self.called.items() if test not in self.failed}
        return {"seconds": seconds, "calls": calls, "early": sorted(self.early)}
