"""Runs of both loops, and of another process, compared to the last bit."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from support.doors import make_scenario
from support.rollout import name_samples, roll_out

ELSEWHERE = """
import sys
import numpy as np
sys.path.append({tests!r})
from support.doors import compose_config, make_scenario
from support.rollout import roll_out

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
    columns, others = name_samples(one.samples), name_samples(other.samples)
    assert not [name for name in columns if not same_bits(columns[name], others[name])]
    assert same_bits(one.body_samples, other.body_samples)


def run_both(config):
    """The run of the fused loop, which that of the stepped loop equals."""
    fused, stepped = roll_out(make_scenario(config)), roll_out(make_scenario(config), fused=False)
    require_same_bits(fused, stepped)
    assert fused.events == stepped.events
    return fused
