"""Runs of both loops, and of another process, compared to the last bit."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from support.rollout import roll_out

from cmacexp.loop.samples import name_samples
from cmacexp.loop.scenario import make_scenario

ELSEWHERE = """
import sys
from pathlib import Path
import numpy as np
from cmacexp.config.compose import compose_config
from cmacexp.data.parquet import write_table
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.trace import assemble
sys.path.append({tests!r})
from support.rollout import roll_out

folder, config = Path(sys.argv[1]), compose_config(sys.argv[2:])
run = roll_out(make_scenario(config))
np.savez(folder / "run.npz", samples=run.samples, body_samples=run.body_samples, status=run.status, cause=run.cause)
write_table(assemble(run.plan, run.columns(), config.sampling_period), folder / "trace.parquet")
"""


def run_elsewhere(folder, overrides, **environment):
    """A run in another process, whose trace it leaves in ``folder``."""
    command = [sys.executable, "-c", ELSEWHERE.format(tests=str(Path(__file__).parents[1])), str(folder), *overrides]
    subprocess.run(command, env={**os.environ, **environment}, check=True)
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
