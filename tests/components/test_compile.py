"""Compiled code lasts from process to process wherever it can be kept, and is never older than its sources."""

import re
import shutil
from types import FunctionType

import pytest
from support.command import ROOT, python

from cmacexp.jit.compiler import program
from cmacexp.jit.numba_private import TESTED
from cmacexp.models.mix import mix

SCRIPT = """
from cmacexp.jit.compiler import call_before_compiling, program
from cmacexp.models.ground import ALL_LEGS, NEVER, Ground, stiffness_at

call_before_compiling(lambda: print("compiles"))
print(program(stiffness_at)(Ground(1e4, 0.1, 0.5, 7, 0.0, NEVER, 1.0, ALL_LEGS, 0.0, 0.0), 0.25, -0.35))
"""


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
    """What a new process says of the ground, and whether it had to compile for that."""
    kept = {"PYTHONPATH": str(package.parent), "NUMBA_CACHE_DIR": "", "PYTHONDONTWRITEBYTECODE": "1", **environment}
    done = python("-c", SCRIPT, folder=package.parent, **kept)
    assert done.returncode == 0, done.stderr
    *announced, value = done.stdout.split()
    return float(value), announced == ["compiles"]


def files(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


def test_a_read_only_install_compiles_once_into_the_users_cache(install, tmp_path):
    before = files(install)
    first, compiled = stiffness(install, XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert compiled
    assert stiffness(install, XDG_CACHE_HOME=str(tmp_path / "cache")) == (first, False)
    assert files(install) == before


def test_where_the_home_folder_cannot_be_written_a_temporary_folder_keeps_it(install, tmp_path):
    home, temporary = tmp_path / "home", tmp_path / "temporary"
    home.write_text("a file, so that not even root can make a folder in it")
    temporary.mkdir()
    nowhere = {"HOME": str(home), "XDG_CACHE_HOME": "", "TMPDIR": str(temporary)}
    first, compiled = stiffness(install, **nowhere)
    assert compiled
    assert stiffness(install, **nowhere) == (first, False)
    (folder,) = temporary.iterdir()
    assert folder.stat().st_mode & 0o077 == 0  # code that others could replace would run as the user


def test_an_edit_of_what_a_kernel_calls_is_never_missed(install, tmp_path):
    kept = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    first, _ = stiffness(install, **kept)
    callee = install / "models" / "mix.py"
    text = callee.read_text()
    callee.chmod(0o644)
    callee.write_text(text.replace("0x5BD1E995", "0x5BD1E997"))
    second, compiled = stiffness(install, **kept)
    assert compiled
    assert second != first
    callee.write_text(text)
    assert stiffness(install, **kept) == (first, False)


def test_private_names_of_numba_are_used_with_the_versions_that_the_package_allows():
    first, limit = re.search(r'"numba>=([\d.]+),<([\d.]+)"', (ROOT / "pyproject.toml").read_text()).groups()
    assert tuple(tuple(map(int, version.split("."))) for version in (first, limit)) == TESTED


def test_a_kernel_is_a_plain_function_and_a_program_gives_its_bits():
    assert isinstance(mix, FunctionType)
    assert program(mix)(7, 12345) == mix(7, 12345)
