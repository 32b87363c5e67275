"""A scenario run with all its samples in memory."""

from dataclasses import dataclass

import numpy as np

from cmacexp.loop import End, stream
from cmacexp.loop.samples import WIDE_BODY_SAMPLES, name_samples
from cmacexp.planning import Plan


@dataclass(kw_only=True)
class Rollout(End):
    """How it ended, and its samples: of legs (steps, L, columns), of the body (steps, columns)."""

    plan: Plan
    samples: np.ndarray
    body_samples: np.ndarray

    def columns(self):
        """Samples (steps, L) by column name."""
        return name_samples(np.moveaxis(self.samples, 2, 0))

    def body_columns(self):
        """Samples of the body (steps,) by column name."""
        return name_samples(self.body_samples.T, WIDE_BODY_SAMPLES)


def roll_out(scenario, on_progress=lambda cycles: None) -> Rollout:
    kept = []
    end = stream(scenario, kept.append, on_progress)
    samples = np.concatenate([np.moveaxis(new.legs, 0, 2) for new in kept])
    body = np.concatenate([new.body.T for new in kept])
    return Rollout(**vars(end), plan=scenario.setup.plan, samples=samples, body_samples=body)
