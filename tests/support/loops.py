"""Runs of built-in and external components, and of another process, compared to the last bit."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from support.doors import make_scenario, roll_out

ELSEWHERE = """
import sys
import numpy as np
sys.path.append({tests!r})
from support.doors import compose_config, make_scenario, roll_out

run = roll_out(make_scenario(compose_config(sys.argv[2:])))
np.savez(sys.argv[1], samples=run.samples, body_samples=run.body_samples, status=run.status, cause=run.cause)
"""


def run_elsewhere(folder, overrides, **environment):
    """A run in another process."""
    command = [sys.executable, "-c", ELSEWHERE.format(tests=str(Path(__file__).parents[1])), str(folder / "run.npz")]
    subprocess.run([*command, *overrides], env={**os.environ, **environment}, check=True)
    with np.load(folder / "run.npz") as run:
        return SimpleNamespace(**{name: run[name] if run[name].ndim else str(run[name]) for name in run})


def same_bits(one, other):
    return one.shape == other.shape and one.tobytes() == other.tobytes()


def require_same_bits(one, other):
    """Require that two runs ended alike, and took the same steps."""
    assert (one.status, one.cause) == (other.status, other.cause)
    assert same_bits(one.samples, other.samples)
    assert same_bits(one.body_samples, other.body_samples)


class External:
    """Does what a built-in component does, which the loop then does not know."""

    def __init__(self, component):
        self.component = component

    def __getattr__(self, name):
        return getattr(self.component, name)


def make_external(scenario, *groups):
    """The scenario with the components of these ``groups`` external."""
    return replace(scenario, **{group: External(getattr(scenario, group)) for group in groups})


def run_both(config):
    """The run of built-in components, which that of external ones equals."""
    run = roll_out(make_scenario(config))
    hooked = roll_out(make_external(make_scenario(config), "plant", "sensors", "controller"))
    require_same_bits(run, hooked)
    assert run.guard == hooked.guard
    return run
