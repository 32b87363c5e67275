"""What the tests share: three tiers, runs that are made once, configs composed as the command line composes them.

A test without a mark belongs to the first tier, which README's command runs: it starts no process and needs no MuJoCo
(:mod:`support.tiers` enforces both), and should take less than a second. ``ci`` marks what CI runs too, ``nightly``
what takes long.
"""

import math
import os
from functools import cache
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import settings
from support import tiers
from support.command import started
from support.controllers import write_module
from support.doors import compose_config, make_mechanism
from support.stored import make_stored, runs_folder

from cmacexp.jit.compiler import expect_runs, workload
from cmacexp.jit.sources import cache_folder
from cmacexp.planning import make_plan

settings.register_profile("laws", deadline=None, derandomize=True, max_examples=40)
settings.register_profile("nightly", deadline=None, derandomize=False, max_examples=400, print_blob=True)
settings.load_profile("laws")
"""The same examples each time; ``pytest --hypothesis-profile=nightly`` draws others, and says how to repeat one."""

LONG = 100
"""Cycles of one leg that repay compiling."""
FORMS = 2
"""Of the loop: with built-in components alone, and with others."""


def pytest_configure(config):
    """Watch the tests of the first tier."""
    config.pluginmanager.register(tiers, "tiers")


def pytest_sessionstart(session):
    """Compile both forms of the loop, unless the cache has them: later each process would, during a test."""
    only_looks = session.config.option.collectonly or hasattr(session.config, "workerinput")
    if not (only_looks or os.environ.get("NUMBA_DISABLE_JIT")) and len([*cache_folder().glob("*/step.*")]) < FORMS:
        with TemporaryDirectory() as folder:
            run = (f"cycles={LONG}", "record=trace")
            forms = [
                started(*run, *more, folder=folder)
                for more in (["hydra.run.dir=a"], ["sensors=noisy_force", "hydra.run.dir=b"])
            ]
            for form in forms:
                form.communicate()


@pytest.fixture(scope="session", autouse=True)
def little_work():
    """What fixtures call outside of a run is work of one step, which repays no compiling."""
    with workload(1):
        yield


@pytest.fixture(autouse=True)
def one_step():
    """The same of each test: the programs that an earlier one took, and the runs it announced, are not its own."""
    expect_runs(1)
    with workload(1):
        yield


@pytest.fixture
def compiled():
    """Programs are compiled, or read from the cache, however little they do."""
    expect_runs(math.inf)
    with workload(math.inf):
        yield


@pytest.fixture
def here(request, tmp_path, monkeypatch):
    """The module with the ``COMPONENTS`` of the file, in the current folder; no other test has imported it."""
    monkeypatch.chdir(tmp_path)
    return write_module(tmp_path, request.module.COMPONENTS)


@pytest.fixture(scope="session")
def make_config():
    """``make_config("scenario=one_leg", "cycles=2")`` gives a Config."""
    return lambda *overrides: compose_config(overrides)


@pytest.fixture(scope="session")
def plan_of(make_config):
    """``plan_of("scenario=quadruped")`` gives the plan of that command line; each is made once, to be read alone."""

    @cache
    def plan(*overrides):
        config = make_config(*overrides)
        made = make_plan(config, make_mechanism(config.machine), True)
        for part in made:
            if isinstance(part, np.ndarray):
                part.flags.writeable = False
        return made

    return plan


@pytest.fixture(scope="session")
def stored(request):
    """``stored("scenario=one_leg", "cycles=3")`` gives the :class:`cmacexp.Run` of a run that all tests share.

    It is made once for a state of the code, whichever process needs it first, and kept in pytest's cache. Tests read
    it; one that changes a run copies its ``folder`` first.
    """
    folder = runs_folder(request.config)
    return cache(lambda *overrides: make_stored(folder, overrides))


@pytest.fixture(scope="session")
def leg(stored):
    """The run of a leg that learns, with its weights, for tests that need a run and no particular one."""
    return stored("scenario=one_leg", "cycles=3", "record.weights=true")


@pytest.fixture(scope="session")
def walk(stored):
    """The run of a machine of four legs, likewise."""
    return stored("scenario=quadruped", "cycles=1")
