"""Named arrays of a plan: the motion of feet or joints, and the reference that the controller follows."""

import warnings
from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array

X, Y, Z = range(3)
"""Axes of a foot in the frame of its hip: forward, down, and to the left where feet move in space."""
BEFORE, ACTING = range(2)
"""Stages of a run, the first axis of a plan's ControlReference: before the feedforward acts, and since."""


class Motion(NamedTuple):
    """Motion of feet or joints over a cycle, (N, L, J) each; in one step (L, J), along one axis (N,) or (N, L)."""

    position: Array
    """m; of joints rad."""
    velocity: Array
    """m/s; of joints rad/s."""
    acceleration: Array
    """m/s^2; of joints rad/s^2."""


class ControlReference(NamedTuple):
    """What the controller follows; in one step without the axes of stages and samples, (L, J) and (L,)."""

    position: Array
    """(2, N, L, J): m; in support NaN along y where the method uses none."""
    velocity: Array
    """(2, N, L, J): m/s; in support NaN along y where the method uses none."""
    force_reference: Array
    """(2, N, L): F_r, N; in support NaN where the method uses none."""
    force_added: Array
    """(2, N, L): force added to the feedback, N."""
    force_desired: Array
    """(2, N, L): desired contact force, N."""


@kernel
def select(plan: ControlReference, stage: int, sample: int) -> ControlReference:
    """What the controller follows in a ``sample`` of a ``stage``: views (L, J) and (L,)."""
    return ControlReference(
        plan.position[stage, sample],
        plan.velocity[stage, sample],
        plan.force_reference[stage, sample],
        plan.force_added[stage, sample],
        plan.force_desired[stage, sample],
    )


def read_old_columns(old: str, new: str, row: Motion | ControlReference) -> Array:
    """One step (L, columns) under its ``old`` name: x and y of each field, in its unit, forces, then all z; warns."""
    warnings.warn(f"{old} will go: use {new}, whose arrays have names", FutureWarning, stacklevel=3)
    fields = [values if values.ndim > 1 else values[:, None] for values in row]
    return np.concatenate([values[:, :Z] for values in fields] + [values[:, Z:] for values in fields], axis=1)
