"""Compiled code lasts from process to process wherever it can be kept, and is never older than its sources."""

import contextlib
import math
import os
import random
import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from types import FunctionType, SimpleNamespace

import pytest
from support.command import ROOT, cmacexp, python

from cmacexp.jit.compiler import WORTH_COMPILING, expect_runs, expect_steps, program
from cmacexp.jit.numba_private import CheckedFiles, compiled_program
from cmacexp.jit.sources import cache_folder, is_private
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.mix import mix
from cmacexp.report.terminal import COMPILING

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


def test_a_read_only_install_compiles_into_the_users_cache_even_if_two_begin_at_once(install, tmp_path):
    before, cache = files(install), str(tmp_path / "cache")
    with ThreadPoolExecutor() as pool:
        found = list(pool.map(lambda _: stiffness(install, XDG_CACHE_HOME=cache), range(2)))
    assert sorted(compiled for _, compiled in found) == [False, True]
    assert len({value for value, _ in found}) == 1
    assert stiffness(install, XDG_CACHE_HOME=cache) == (found[0][0], False)
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


def test_a_user_without_a_home_folder_has_a_temporary_one(tmp_path, monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path)  # as Python does where it finds no home
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.chdir(tmp_path)
    assert cache_folder.__wrapped__().is_relative_to(tmp_path / "temporary")
    assert [path.name for path in tmp_path.iterdir()] == ["temporary"]


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


def compiles(folder, *overrides, **environment):
    """Whether a run says that it compiles, and whether it leaves compiled code."""
    cache = folder / "cache"
    done = cmacexp(
        *overrides, "record=trace", "hydra.run.dir=run", folder=folder, NUMBA_CACHE_DIR=str(cache), **environment
    )
    assert done.returncode == 0, done.stderr
    return COMPILING in done.stderr, any(cache.rglob("*.nbc"))


def test_a_short_run_is_not_compiled(tmp_path):
    assert compiles(tmp_path, "cycles=2") == (False, False)


def is_worth_it():
    """Whether a program that is not cached is compiled now."""
    asked = program(lambda: None)
    asked.compiled = lambda: "compiled"
    asked._is_cached = lambda arguments: False
    return asked() == "compiled"


@pytest.mark.parametrize(("scenario", "cycles", "compiled"), [("one_leg", 70, True), ("quadruped", 10, False)])
def test_a_run_decides_by_its_own_length(make_config, scenario, cycles, compiled):
    make_scenario(make_config(f"scenario={scenario}", f"cycles={cycles}"))
    assert is_worth_it() == compiled


def plans(steps, runs=1.0):
    """Whether a program is compiled for so many steps and runs."""
    expect_runs(runs)
    expect_steps(steps)
    try:
        return is_worth_it()
    finally:
        expect_runs(1)


def test_the_length_of_all_runs_together_decides():
    assert not plans(WORTH_COMPILING - 1)
    assert plans(WORTH_COMPILING)
    assert not plans(WORTH_COMPILING / 10, runs=9)
    assert plans(WORTH_COMPILING / 10, runs=10)
    assert plans(1, runs=math.inf)


def test_a_kernel_is_a_plain_function_and_a_program_gives_its_bits():
    assert isinstance(mix, FunctionType)
    assert program(mix).compiled(7, 12345) == mix(7, 12345)


# Damage


def checked(folder, stamp="source"):
    return CheckedFiles(SimpleNamespace(_cache_path=str(folder), _index_name="loop.run-1.nbi", _source_stamp=stamp))


def test_a_form_is_loaded_for_its_key_and_source_alone(tmp_path):
    checked(tmp_path).save("key", [1, 2])
    checked(tmp_path).save("other", [3])
    assert checked(tmp_path).load("key") == [1, 2]
    assert checked(tmp_path).load("other") == [3]
    assert checked(tmp_path).load("third") is None
    assert checked(tmp_path, "edited").load("key") is None


def test_damage_anywhere_is_noticed_before_the_form_is_loaded(tmp_path, capsys):
    made, form = checked(tmp_path), list(range(200))
    made.save("key", form)
    (path,) = tmp_path.iterdir()
    whole, draw = path.read_bytes(), random.Random(7)
    for attempt in range(200):
        content = bytearray(whole)
        if attempt % 2:
            del content[draw.randrange(len(content)) :]
        else:
            content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
        path.write_bytes(content)
        assert made.load("key") is None
        assert capsys.readouterr().err.startswith(f"{path}: compiled code was damaged")
        assert not path.exists()
    assert made.load("key") is None
    made.save("key", form)
    assert made.load("key") == form


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_form_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch, error):
    def fail(*paths):
        raise error

    monkeypatch.setattr(os, "replace", fail)
    with contextlib.suppress(KeyboardInterrupt):
        checked(tmp_path).save("key", "form")
    assert not list(tmp_path.iterdir())


def test_a_damaged_program_is_compiled_again(tmp_path, capsys):
    assert compiled_program(mix, tmp_path)(7, 12345) == mix(7, 12345)
    (path,) = [path for path in files(tmp_path) if path.suffix == ".nbc"]
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    assert compiled_program(mix, tmp_path)(7, 12345) == mix(7, 12345)
    assert "compiled code was damaged" in capsys.readouterr().err
    assert path.stat().st_size > 1000
    again = compiled_program(mix, tmp_path)
    assert again(7, 12345) == mix(7, 12345)
    assert sum(again.stats.cache_hits.values()) == 1
    assert not capsys.readouterr().err


# Folders that others can write to


@pytest.mark.parametrize(
    ("mode", "used"), [(0o700, True), (0o755, True), (0o775, False), (0o702, False), (0o1777, False)]
)
def test_a_folder_that_others_can_write_to_is_not_used(tmp_path, mode, used, monkeypatch, capsys):
    own = tmp_path / "shared" / "cmacexp"
    own.mkdir(parents=True)
    own.chmod(mode)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "shared"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = cache_folder.__wrapped__()
    assert folder.parent == (own if used else tmp_path / f"cmacexp-{os.getuid()}")
    assert capsys.readouterr().err == (
        "" if used else f"{own} is not used for compiled code: it must be your own, and others must not write to it\n"
    )


def test_a_new_folder_is_private(tmp_path):
    (tmp_path / "shared").mkdir(mode=0o777)
    assert is_private(tmp_path / "shared" / "own")
    assert (tmp_path / "shared" / "own").stat().st_mode & 0o777 == 0o700


def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    if os.getuid() == 0:
        os.chown(tmp_path, 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert not is_private(tmp_path)
