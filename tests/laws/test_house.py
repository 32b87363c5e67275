"""The house: which room may use which, what tests may import, and that a fact is declared once."""

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

import pytest
from support.doors import KERNEL_ROOMS, RESULT_ROOMS, step

import cmacexp
from cmacexp.__main__ import run_words

ROOMS = "errors+typing+entry_points jit models config data cmac planning protocols plants sensors feedforward control"
LAYERS = f"{ROOMS} loop metrics terminal recording report engine gym commands+__main__ addons".split()
"""Each imports only from its own layer and those before it."""
READERS = {"metrics", "recording", "report"}
"""Rooms that read what is on disk and never reach the loop."""
MAINS = {"replay", "robots", "score", "verify", "video", "warm", "stability", "gap", "export"}
ADDONS = {"study", "stability", "gap", "unitree", "export", "video"}
"""Modules beside the rooms that run the command of their name."""
NUMBERED = Counter({number: 1 for number in (1, 2, *range(5, 22))}) + Counter({23: 2})
"""Equations of the paper that the code computes, and how often: M of 23 in one function, C and G in another."""
NOT_OF_A_RUN = ("matplotlib", "jinja2", "scipy.signal", "scipy.optimize", "rich")
TESTS, ROOT = Path(__file__).parents[1], Path(__file__).parents[2]
MODULES, STUDIES = (
    [package.__name__, *(each.name for each in pkgutil.walk_packages(package.__path__, f"{package.__name__}."))]
    for package in map(importlib.import_module, ("cmacexp", "pipelines"))
)
ALL = frozenset({*MODULES, *STUDIES})


text_of = cache(lambda module: Path(importlib.util.find_spec(module).origin).read_text())
tree_of = cache(lambda module: ast.parse(text_of(module)))


def named_in(tree: ast.Module) -> set[str]:
    """Whatever a module imports, lazily too."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            inner = {alias.name: f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in ALL else node.module for name in inner.values()}
    return found


@cache
def imports(module: str) -> set[str]:
    return (named_in(tree_of(module)) & ALL) - {module}


@cache
def reach(module: str) -> set[str]:
    """All modules that ``module`` imports, by whatever way."""
    seen, todo = set(), [module]
    while todo:
        new = imports(todo.pop()) - seen
        seen |= new
        todo += new
    return seen


@pytest.fixture(scope="module", autouse=True)
def read():
    """Read the package before the tests."""
    for module in ALL:
        imports(module)


def room_of(module: str) -> str:
    """The room of a module; the package itself hands on the API, and what only runs a command is one of commands."""
    _, *inside = module.split(".")
    if inside == ["study"]:  # the names of the add-on, as users import them
        return "addons"
    return ("__main__" if inside[-1] == "__main__" or inside[0] in MAINS else inside[0]) if inside else "engine"


def layer_of(module: str) -> int:
    return next((i for i, rooms in enumerate(LAYERS) if room_of(module) in rooms.split("+")), len(LAYERS))


def test_a_room_imports_only_from_the_layers_above_it_and_readers_never_reach_the_loop():
    assert {room_of(module) for module in MODULES} == set("+".join(LAYERS).split("+"))
    for module in MODULES:
        assert not [used for used in imports(module) if used in STUDIES or layer_of(used) > layer_of(module)], module
        assert room_of(module) not in READERS or "loop" not in map(room_of, reach(module)), module


def test_an_add_on_imports_no_other_and_what_exports_never_reaches_the_loop():
    assert {module.split(".")[2] for module in MODULES if module.startswith("cmacexp.addons.")} == ADDONS
    for module in MODULES:
        if module.startswith("cmacexp.addons."):
            others = [used for used in imports(module) if used.startswith("cmacexp.addons.")]
            assert {used.split(".")[2] for used in others} <= {module.split(".")[2]}, module
    for name in ("network", "c_code", "tables"):
        assert "loop" not in map(room_of, reach(f"cmacexp.addons.export.{name}")), name


def test_no_module_imports_itself_by_a_detour_and_files_are_short():
    assert not [module for module in ALL if module in reach(module)]
    assert not [module for module in ALL if len(text_of(module).splitlines()) > 400]


def is_outside(module: str, rooms) -> bool:
    """Whether a module is in none of ``rooms``, folders or files as :mod:`cmacexp.jit.sources` names them."""
    return not {f"{module.partition('.')[2].replace('.', '/')}.py", room_of(module)} & {*rooms}


def test_hashes_cover_what_compiled_code_and_results_depend_on():
    rooms = {*KERNEL_ROOMS, "typing.py", "errors.py", "config"}  # those besides have no constants of kernels
    for module in MODULES:
        assert "@kernel" not in text_of(module) or not [m for m in imports(module) if is_outside(m, rooms)], module
    only_shown = {"recording", "errors.py", "entry_points.py", "engine/stop_cause.py"}
    assert not [m for m in reach("cmacexp.engine.run") if is_outside(m, {*RESULT_ROOMS, *only_shown})]


@pytest.mark.ci
def test_examples_in_docstrings_give_what_they_say():
    shown = [module for module in MODULES if "    >>> " in text_of(module)]
    results = [doctest.testmod(importlib.import_module(module)) for module in shown]
    assert all(found.attempted and not found.failed for found in results), shown


@pytest.mark.ci
@pytest.mark.parametrize(
    ("work", "heavy"),
    [
        ("from cmacexp.commands import main; assert main.main() == 0", NOT_OF_A_RUN),
        ("from cmacexp.commands import main", (*NOT_OF_A_RUN, "pandas", "rerun", "scipy", "numba", "pyarrow")),
        (
            "from cmacexp.cmac import Cmac; Cmac([0], [1])",
            ("hydra", "omegaconf", "pandas", "pyarrow", "numba", "scipy"),
        ),
        ("from cmacexp import load_sweep", ("cmacexp.loop", "cmacexp.plants", "hydra", "numba", "rerun", "scipy")),
    ],
    ids=["a run", "its start", "a CMAC alone", "a sweep that is read"],
)
def test_nothing_is_imported_that_is_not_needed(tmp_path, work, heavy):
    code = f"import sys; sys.argv = ['', 'hydra.run.dir={tmp_path}']; {work}; print({{*{heavy}}} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"


MOST_FRAMES, MOST_MODULES = 14, 150


def test_the_main_path_is_short(tmp_path, monkeypatch):
    """Frames of this package from the command to a control equation, and modules that a run of one leg imports."""
    path = []

    def look(*arguments):
        frame = sys._getframe(1)
        while frame and not path:
            if frame.f_code.co_filename.startswith(str(Path(cmacexp.__file__).parent)):
                names.append(f"{Path(frame.f_code.co_filename).stem}.{frame.f_code.co_name}")
            frame = frame.f_back
        path.extend(names)
        return control(*arguments)

    names, control = [], step.hybrid_feedback
    monkeypatch.setattr(step, "hybrid_feedback", look)
    monkeypatch.setattr(step.step_loop, "forms", {})  # that earlier tests have compiled
    monkeypatch.setattr(step.step_loop, "last", step.step_loop.last._replace(chosen=step.step_loop.plain))
    monkeypatch.setattr(sys, "argv", ["cmacexp", "cycles=1", "record=metrics", f"hydra.run.dir={tmp_path / 'run'}"])
    assert run_words() == 0
    assert names[-1] == "__main__.run_words"
    assert len(names) <= MOST_FRAMES, names


@pytest.mark.ci
def test_a_run_of_one_leg_imports_few_modules(tmp_path):
    words = ["", "cycles=1", "record=metrics", f"hydra.run.dir={tmp_path / 'run'}"]
    code = f"import sys; sys.argv = {words}; from cmacexp.__main__ import run_words; run_words(); "
    code += "print(sum(name.split('.')[0] == 'cmacexp' for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout.splitlines()[-1]) <= MOST_MODULES


def test_every_equation_and_version_stands_once():
    """Docstrings of functions that compute an equation give the paper, or the law that solves it; others refer."""
    found = Counter()
    functions = [n for m in MODULES for n in ast.walk(tree_of(m)) if isinstance(n, ast.FunctionDef)]
    text = "\n".join(ast.get_docstring(function) or "" for function in functions)
    for listed in re.findall(r"(?:Song 1997,|solves) eq\. (\d+(?:(?:-|, )\d+)*)", text):
        for low, high in re.findall(r"(\d+)(?:-(\d+))?", listed):
            found.update(range(int(low), int(high or low) + 1))
    assert found == NUMBERED
    assert re.search(r"^## (\d\S*)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1] == cmacexp.__version__


def test_every_name_on_the_page_of_the_main_path_exists():
    names = re.findall(r"`(cmacexp\.[\w.]+)`", (ROOT / "docs" / "contributing.md").read_text())
    assert "cmacexp.loop.step.take_steps" in names
    for name in names:
        assert pkgutil.resolve_name(name) is not None


def test_a_test_imports_inner_modules_of_its_own_room_only():
    wrong = []
    for file in TESTS.glob("*/**/*.py"):
        folder = file.relative_to(TESTS).parts[0]
        if folder != "support":
            for name in named_in(ast.parse(file.read_text())):
                package, *inside = name.split(".")
                is_inner = package == "cmacexp" and len(inside) > 1
                wrong_room = is_inner and inside[0] != folder
                if wrong_room or (package in {"pipelines", "benchmarks"} and folder not in {"studies", "commands"}):
                    wrong.append((str(file.relative_to(TESTS)), name))
    assert not wrong
