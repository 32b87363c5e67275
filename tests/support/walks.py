"""Walks of the quadruped from the command line (Lin & Song 1997, section 6), and what they leave."""

import json

import numpy as np
import pandas as pd
from support.command import cmacexp

STEPS = 600
"""Of a cycle."""
PERIOD = 0.005
WEIGHT = 40.0
HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])
LIFT_OFF = (480, 180, 360, 60)
TOUCH_DOWN = (0, 300, 480, 180)
"""Samples of the cycle, by leg."""


class Run:
    """What a command left: its folder, its exit code, and its tables as arrays."""

    def __init__(self, folder, done):
        self.folder, self.code, self.done = folder, done.returncode, done
        self.manifest = json.loads((folder / "manifest.json").read_text())
        trace = pd.read_parquet(folder / "trace.parquet")
        assert trace.leg[:4].tolist() == [1, 2, 3, 4]
        self.trace = {name: trace[name].to_numpy().reshape(-1, 4) for name in trace.columns}
        self.body = pd.read_parquet(folder / "body.parquet")
        self.metrics = pd.read_parquet(folder / "metrics.parquet").set_index(["cycle", "leg"])
        self.body_metrics = pd.read_parquet(folder / "body_metrics.parquet").set_index("cycle")

    def of_cycle(self, name, cycle):
        """A column of the trace (600, 4) in one cycle."""
        return self.trace[name][(cycle - 1) * STEPS : cycle * STEPS]

    def transfer_rmse(self, axis, cycle):
        """Transfer error over all legs, m."""
        error = self.of_cycle(axis, cycle) - self.of_cycle(f"{axis}_desired", cycle)
        return np.sqrt((error[self.of_cycle("phase", cycle) == "transfer"] ** 2).mean())

    def share(self, cycle):
        """What the feedforward does of all torque, over all legs."""
        parts = [
            sum(np.abs(self.of_cycle(f"tau_{part}_{j}", cycle)).sum() for j in (1, 2))
            for part in ("feedforward", "feedback")
        ]
        return parts[0] / sum(parts)

    def pooled(self):
        """Root mean square over the legs of every metric, and the body's metrics, by cycle."""
        legs = (self.metrics**2).groupby(level="cycle").mean() ** 0.5
        return legs.join(self.body_metrics).dropna(axis=1, how="all")


ALL_THREE = ("cycles=20",)
FEEDBACK = ("feedforward=none",)
LITERAL = ("reference=literal",)
FALLING = ("posture.gain=0",)
FALLING_AT_ONCE = ("posture.gain=0", "feedforward=none")
PATCHY = ("terrain=patchy", "gait.load_ramp=0.1", "cycles=6")
WALKS = [ALL_THREE, FEEDBACK, LITERAL, PATCHY, FALLING]


def walk_in(folder, *overrides):
    """The walk of a command line."""
    done = cmacexp("scenario=quadruped", *overrides, "record=trace", f"hydra.run.dir={folder}", folder=folder)
    assert done.returncode in (0, 3), done.stderr
    return Run(folder, done)
