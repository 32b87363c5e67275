"""A scenario run with its whole trace in memory."""

from dataclasses import dataclass

import numpy as np

from cmacexp.data.records import RunEnd
from cmacexp.loop import run_cycles
from cmacexp.loop.samples import ALL_SAMPLES, WIDE_BODY_SAMPLES
from cmacexp.planning import Plan


@dataclass(kw_only=True)
class Rollout(RunEnd):
    """How it ended, and what the loop sampled."""

    plan: Plan
    traces: list

    def columns(self):
        """Samples (steps, L) by column name."""
        return self._join(self.traces, ALL_SAMPLES)

    def body_columns(self):
        """Samples of the body (steps,) by column name."""
        return self._join([trace.body for trace in self.traces if trace.body], WIDE_BODY_SAMPLES)

    @property
    def samples(self):
        """Samples of the legs (steps, L, columns)."""
        return np.stack([*self.columns().values()], axis=2)

    @property
    def body_samples(self):
        """Samples of the body (steps, columns)."""
        return np.stack([*self.body_columns().values()] or [np.zeros(0)], axis=1)

    def _join(self, traces, names):
        names = [name for name in names if traces and name in traces[0].names]
        return {name: np.concatenate([trace[name] for trace in traces]) for name in names}


def roll_out(scenario, on_progress=lambda cycles: None) -> Rollout:
    traces = list(run_cycles(scenario, on_progress))
    return Rollout(**vars(scenario.end), plan=scenario.setup.plan, traces=traces)
