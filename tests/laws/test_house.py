"""The house: which room may use which, how large a file may be, and that compiled code is never stale."""

import ast
import doctest
import importlib
import importlib.util
import pkgutil
import re
import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

import cmacexp
import pipelines
from cmacexp.jit.sources import KERNEL_ROOMS, RESULT_ROOMS

LAYERS = (
    {"errors", "typing"},
    {"jit"},
    {"models"},
    {"config"},
    {"data"},
    {"cmac"},
    {"planning"},
    {"plants"},
    {"sensors"},
    {"feedforward"},
    {"control"},
    {"loop"},
    {"metrics"},
    {"recording"},
    {"report"},
    {"stability"},
    {"study"},
    {"export"},
    {"experiment"},
    {"gym"},
    {"commands", "__main__"},
)
"""Rooms of the package; each imports only from its own layer and those above it in this list."""
OVER_STUDIES = {"pipelines", "pipelines.__main__", "pipelines.paper", "pipelines.quotes"}
"""What is about several studies."""
READERS = {"metrics", "recording", "report", "study", "export"}
"""Rooms that read what is on disk and never reach the loop."""


def modules_of(package) -> list[str]:
    found = pkgutil.walk_packages(list(package.__path__)[:1], f"{package.__name__}.")  # commands are found once
    return [package.__name__, *(name for _, name, _ in found)]


MODULES, STUDIES = modules_of(cmacexp), modules_of(pipelines)
ALL = frozenset({*MODULES, *STUDIES})


@cache
def text_of(module: str) -> str:
    return Path(importlib.util.find_spec(module).origin).read_text()


@cache
def imports(module: str) -> set[str]:
    """Modules of the project that ``module`` imports, lazily too."""
    found = set()
    for node in ast.walk(ast.parse(text_of(module))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = {alias.name: f"{node.module}.{alias.name}" for alias in node.names}
            found |= {inner if inner in ALL else node.module for inner in names.values()}
    return (found & ALL) - {module}


@cache
def reach(module: str) -> set[str]:
    """All modules that ``module`` imports, by whatever way."""
    seen, todo = set(), [module]
    while todo:
        new = imports(todo.pop()) - seen
        seen |= new
        todo += new
    return seen


def room_of(module: str) -> str:
    """The room of a module; the package itself hands on the API, and a ``__main__`` is a command."""
    _, *inside = module.split(".")
    if not inside:
        return "experiment"
    return "__main__" if inside[-1] == "__main__" else inside[0]


def layer_of(room: str, layers) -> int:
    return next((index for index, rooms in enumerate(layers) if room in rooms), len(layers))


def test_every_room_has_a_layer():
    rooms = {room_of(module) for module in MODULES}
    assert rooms == set().union(*LAYERS)


def test_a_room_imports_only_from_the_layers_above_it():
    upward = {
        (module, used)
        for module in MODULES
        for used in imports(module)
        if used.startswith("pipelines") or layer_of(room_of(used), LAYERS) > layer_of(room_of(module), LAYERS)
    }
    assert not upward


def test_what_reads_a_trace_never_reaches_the_loop():
    assert not [m for m in MODULES if room_of(m) in READERS and "loop" in {room_of(used) for used in reach(m)}]


def test_no_module_imports_itself_by_a_detour():
    assert not [module for module in [*MODULES, *STUDIES] if module in reach(module)]


def outside(modules: set[str], rooms) -> set[str]:
    """Modules in none of ``rooms``, which are folders or files as :mod:`cmacexp.jit.sources` names them."""
    files = {module: f"{module.partition('.')[2].replace('.', '/')}.py" for module in modules}
    return {module for module, file in files.items() if not {file, room_of(module)} & {*rooms}}


def test_what_a_kernel_uses_keys_the_cache_of_compiled_code():
    without_constants = {"typing.py", "errors.py", "config"}
    for module in MODULES:
        if "@kernel" in text_of(module):
            assert not outside(imports(module), {*KERNEL_ROOMS, *without_constants}), module


def test_the_code_hash_covers_all_that_a_result_depends_on():
    only_shown = {"recording", "errors.py", "experiment/failure.py", "experiment/stop_cause.py"}
    assert not outside(reach("cmacexp.experiment.run"), {*RESULT_ROOMS, *only_shown})


def test_files_are_short_and_public_names_documented():
    for module in [*MODULES, *STUDIES]:
        text = text_of(module)
        assert len(text.splitlines()) <= 400, module
        for node in ast.parse(text).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{module}.{node.name}"


def test_examples_in_docstrings_give_what_they_say():
    shown = [module for module in MODULES if "    >>> " in text_of(module)]
    results = [doctest.testmod(importlib.import_module(module)) for module in shown]
    assert all(found.attempted and not found.failed for found in results), shown


def test_starting_imports_nothing_that_only_some_runs_need():
    heavy = ["rerun", "pandas", "matplotlib", "scipy", "numba", "pyarrow"]
    code = f"import sys, cmacexp.commands.main; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_run_imports_nothing_that_it_does_not_need(tmp_path):
    heavy = ["pandas", "matplotlib", "jinja2", "scipy.linalg", "scipy.signal", "scipy.optimize", "rich"]
    code = (
        f"import sys; sys.argv = ['cmacexp', 'hydra.run.dir={tmp_path}']; from cmacexp.commands.main import main; "
        f"assert main() == 0; print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


NUMBERED = {1, 2, *range(5, 22), 23}
"""Equations of the paper that the code computes; the others define symbols or repeat one of these."""
STANDS_TWICE = {23}
"""Its M stands in one function, C and G in another."""


def numbers(text: str) -> set[int]:
    """Those of ``1, 16``, ``5-7``."""
    found = set()
    for part in text.split(", "):
        low, _, high = part.partition("-")
        found |= set(range(int(low), int(high or low) + 1))
    return found


def defined(module: str) -> list[int]:
    """Equations that functions of ``module`` compute: their docstrings give the paper, a mere ``eq. 1`` refers.

    A reference law solves the equation of the steady state, which stands nowhere else.
    """
    functions = [node for node in ast.walk(ast.parse(text_of(module))) if isinstance(node, ast.FunctionDef)]
    text = " ".join(ast.get_docstring(function) or "" for function in functions)
    lists = re.findall(r"(?:Lin & Song 1997,|solves) eq\. (\d+(?:(?:-|, )\d+)*)", text)
    return [number for numbered in lists for number in numbers(numbered)]


def test_every_equation_stands_once_under_its_number():
    found = Counter(number for module in MODULES for number in defined(module))
    assert found == {number: 2 if number in STANDS_TWICE else 1 for number in NUMBERED}
