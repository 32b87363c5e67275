"""The house: which room may use which, how large a file may be, and that compiled code is never stale."""

import ast
import importlib.util
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import cmacexp
from cmacexp.compile import ROOMS

PACKAGE = Path(cmacexp.__file__).parent
STAGES = ["config", "scenario", "rollout", "trace", "metrics", "recording", "report"]
"""The way of the data; a stage uses only those before it."""
MODULES = [name for _, name, _ in pkgutil.walk_packages([str(PACKAGE)], "cmacexp.") if not name.endswith("__main__")]


def text_of(module: str) -> str:
    return Path(importlib.util.find_spec(module).origin).read_text()


def is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def imports(module: str) -> set[str]:
    """Modules of the project that ``module`` imports, lazily too."""
    tree = ast.parse(text_of(module))
    used = [n for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and (n.module or "").startswith("cmacexp")]
    names = {(node.module, f"{node.module}.{alias.name}") for node in used for alias in node.names}
    return {inner if is_module(inner) else outer for outer, inner in names} - {"cmacexp"}


def reach(module: str) -> set[str]:
    """All modules that ``module`` imports, by whatever way."""
    seen, todo = set(), [module]
    while todo:
        new = imports(todo.pop()) - seen
        seen |= new
        todo += new
    return seen


def stage_of(module: str) -> str | None:
    room = module.split(".")[1]
    return room if room in STAGES else None


@pytest.mark.parametrize("module", [m for m in MODULES if stage_of(m)])
def test_the_data_flows_one_way(module):
    later = STAGES[STAGES.index(stage_of(module)) + 1 :]
    assert not {used for used in imports(module) if stage_of(used) in later}


@pytest.mark.parametrize("module", [m for m in MODULES if stage_of(m) in ("metrics", "recording", "report")])
def test_what_reads_a_trace_never_reaches_the_rollout(module):
    assert not {used for used in reach(module) if stage_of(used) in ("rollout", "scenario")}


@pytest.mark.parametrize("module", [m for m in MODULES if "@kernel" in text_of(m)])
def test_what_a_kernel_uses_stands_where_its_text_keys_the_cache(module):
    rooms = {room.removesuffix(".py") for room in ROOMS}
    outside = {used for used in imports(module) if used.split(".")[1] not in rooms | {"arrays", "config", "errors"}}
    assert not outside


@pytest.mark.parametrize("module", MODULES)
def test_no_module_imports_itself_by_a_detour(module):
    assert module not in reach(module)


@pytest.mark.parametrize("module", MODULES)
def test_files_are_short_and_public_names_documented(module):
    text = text_of(module)
    assert len(text.splitlines()) <= 400
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            assert ast.get_docstring(node), node.name


def test_starting_imports_nothing_that_only_some_runs_need():
    heavy = ["rerun", "pandas", "matplotlib", "scipy", "numba", "pyarrow"]
    code = f"import sys, cmacexp.cli; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_run_imports_nothing_that_it_does_not_need(tmp_path):
    heavy = ["pandas", "matplotlib", "jinja2", "scipy.linalg", "scipy.signal", "scipy.optimize"]
    code = (
        f"import sys; sys.argv = ['cmacexp', 'hydra.run.dir={tmp_path}']; from cmacexp.cli import main; "
        f"assert main() == 0; print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def cited(text: str) -> set[int]:
    """Numbers in ``eq. 1, 16``, ``eq. 5-7``, ``eq. 13 and 24``."""
    numbers = set()
    for match in re.finditer(r"eq\. (\d+(?:(?:-|, | and | to )\d+)*)", text):
        for part in re.split(r", | and ", match[1].replace(" to ", "-")):
            low, _, high = part.partition("-")
            numbers |= set(range(int(low), int(high or low) + 1))
    return numbers


def test_every_equation_is_found_by_its_number():
    numbered = {1, 2, *range(5, 22), 23}
    assert numbered <= set().union(*(cited(text_of(module)) for module in MODULES))
