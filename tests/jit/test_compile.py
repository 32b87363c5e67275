"""Compiled code lasts from process to process wherever it can be kept, and is never older than its sources."""

import math
import os
import random
import shutil
import tempfile

import pytest
from support.command import ROOT, python
from support.damage import flip

from cmacexp.jit.compiler import WORTH_COMPILING, expect_runs, program, workload
from cmacexp.jit.forms import Form, find_types
from cmacexp.jit.sources import cache_folder, find_refused_cache, is_private

SCRIPT = """
from cmacexp.jit.compiler import call_before_compiling, read_longest_compiling, program
from cmacexp.models.ground import ALL_LEGS, NEVER, Ground, stiffness_at

call_before_compiling(lambda: print(read_longest_compiling() or "unknown"))
print(program(stiffness_at)(Ground(1e4, 0.1, 0.5, 7, 0.0, NEVER, 1.0, ALL_LEGS, 0.0, 0.0), 0.25, -0.35))
"""


def halve(number):
    return 0.5 * number


@pytest.fixture
def install(tmp_path):
    """A copy of the package that nobody may write to."""
    package = tmp_path / "install" / "cmacexp"
    shutil.copytree(ROOT / "cmacexp", package, ignore=shutil.ignore_patterns("__pycache__"))
    for path in package.rglob("*"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    yield package
    for path in package.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)


def stiffness(package, **environment):
    """What a new process says of the ground, and how long compiling took before, if it had to compile for that."""
    kept = {"PYTHONPATH": str(package.parent), "NUMBA_CACHE_DIR": "", "PYTHONDONTWRITEBYTECODE": "1", **environment}
    done = python("-c", SCRIPT, folder=package.parent, **kept)
    assert done.returncode == 0, done.stderr
    *announced, value = done.stdout.split()
    return float(value), announced


def files(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


@pytest.mark.ci
def test_a_read_only_install_compiles_once_into_the_users_cache_and_never_misses_an_edit(install, tmp_path):
    """The edit is of what the kernel calls."""
    before, kept = files(install), {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    found = [stiffness(install, **kept) for _ in range(2)]
    assert [announced for _, announced in found] == [["unknown"], []]
    assert len({value for value, _ in found}) == 1
    assert files(install) == before
    callee = install / "models" / "mix.py"
    text = callee.read_text()
    callee.chmod(0o644)
    callee.write_text(text.replace("0x5BD1E995", "0x5BD1E997"))
    edited, (seconds,) = stiffness(install, **kept)
    assert float(seconds) > 0.0
    assert edited != found[0][0]
    callee.write_text(text)
    assert stiffness(install, **kept) == (found[0][0], [])


@pytest.mark.parametrize(
    ("steps", "runs", "compiled"),
    [
        (WORTH_COMPILING - 1, 1, False),
        (WORTH_COMPILING, 1, True),
        (WORTH_COMPILING / 10, 9, False),
        (WORTH_COMPILING / 10, 10, True),
        (1, math.inf, True),
    ],
)
def test_the_length_of_all_runs_together_decides(steps, runs, compiled, monkeypatch):
    monkeypatch.setattr(Form, "load", lambda form: None)
    monkeypatch.setattr(Form, "compile", lambda form: lambda number: "compiled")
    expect_runs(runs)
    with workload(steps):
        assert (program(halve)(1) == "compiled") == compiled


# Folders that others can write to


@pytest.mark.parametrize(
    ("mode", "used"), [(0o700, True), (0o755, True), (0o775, False), (0o702, False), (0o1777, False), (None, False)]
)
def test_a_folder_that_others_can_write_to_or_that_is_absent_is_not_used(tmp_path, mode, used, monkeypatch):
    own = tmp_path / "shared" / "cmacexp"
    own.mkdir(mode or 0o700, parents=True)
    own.chmod(mode or 0o700)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(own.parent) if mode else "")
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr("os.path.expanduser", lambda path: path)  # as Python does where it finds no home
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert cache_folder.__wrapped__().parent == (own if used else tmp_path / f"cmacexp-{os.getuid()}")
    assert find_refused_cache() == (None if used or mode is None else own)


def test_temporary_folders_of_others_are_passed_over(tmp_path, monkeypatch):
    """Of the same name for all runs, so that what is compiled once is found again."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))  # as a home that does not exist
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folders = [tmp_path / f"cmacexp-{os.getuid()}{end}" for end in ("", "-1")]
    folders[0].mkdir()
    folders[0].chmod(0o777)
    assert [cache_folder.__wrapped__().parent for _ in range(2)] == [folders[1]] * 2
    assert find_refused_cache() == folders[0]


@pytest.mark.ci
def test_a_compiled_form_that_is_not_as_it_was_saved_is_not_loaded(tmp_path):
    """One flipped bit of machine code can end the process by a signal, or give another number."""
    form, chance = Form(halve, find_types([1]), tmp_path / "halve"), random.Random(0)
    assert form.load() is None
    compiled = form.compile()
    assert form.load()(1) == compiled(1) == 0.5
    for _ in range(100):
        path = chance.choice(files(form.folder))
        content = path.read_bytes()
        flip(path, chance)
        assert form.load() is None
        path.write_bytes(content)
    path.write_bytes(content[:-1])
    assert form.load() is None
    form.compile()
    assert form.load()(1) == 0.5
    assert len(list(form.folder.parent.iterdir())) == 1


@pytest.mark.ci
@pytest.mark.usefixtures("compiled")
def test_a_number_of_another_type_is_not_converted():
    """A form for integers would cut off what a float has behind the point."""
    assert list(map(program(halve), (1, 0.5, 3))) == [0.5, 0.25, 1.5]


def test_a_folder_below_one_that_others_can_rename_is_not_used(tmp_path):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    assert not is_private(tmp_path / "open" / "own")
    (tmp_path / "open").chmod(0o1777)  # as /tmp
    assert is_private(tmp_path / "open" / "own")


def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    user = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: user + 1)
    assert not is_private(tmp_path / "own")
