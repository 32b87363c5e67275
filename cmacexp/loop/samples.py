"""Samples of every step, ordered by the table of signals (:mod:`cmacexp.data.signals`)."""

from collections.abc import Sequence

import numpy as np

from cmacexp.control.hybrid_kernels import HybridState
from cmacexp.data.signals import ARRAYS, BODY_SIGNALS, LEG_SIGNALS, SPATIAL_SIGNALS, list_samples
from cmacexp.jit.compiler import kernel
from cmacexp.plants.drives import DRIVE, FEEDFORWARD, TORQUE, Drives
from cmacexp.plants.kernels import PlantState
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import Array

SAMPLES, BODY_SAMPLES = (list_samples(table, wide=False) for table in (LEG_SIGNALS, BODY_SIGNALS))
"""Names of the columns that every run samples, per leg and for the body."""
WIDE_SAMPLES, WIDE_BODY_SAMPLES = (list_samples(table, wide=True) for table in (LEG_SIGNALS, BODY_SIGNALS))
"""Names of the columns with those that altering sensors add at the end."""
ALL_SAMPLES = WIDE_SAMPLES + list_samples(SPATIAL_SIGNALS, wide=True)
"""Names of the leg columns with those of legs with three joints at the end."""


def _find_columns(table: Sequence[str], array: str, end: str = "") -> tuple[int, ...]:
    """Find the indices in ``table`` of the columns of ``array``: by axis x, y and z, or by joint.

    ``end`` is the suffix of their names.
    """
    return tuple(table.index(f"{name}{end}") for name in ARRAYS[array])


FOOT, VELOCITY, Q, DQ, REFERENCE, TAU_FEEDBACK, TAU_FEEDFORWARD = (
    _find_columns(ALL_SAMPLES, array)
    for array in ("foot", "velocity", "q", "dq", "reference", "feedback", "feedforward")
)
FOOT_MEASURED, VELOCITY_MEASURED, Q_MEASURED, DQ_MEASURED = (
    _find_columns(ALL_SAMPLES, array, "_measured") for array in ("foot", "velocity", "q", "dq")
)
FORCE, FORCE_MEASURED, FORCE_TRUSTED = map(ALL_SAMPLES.index, ("force", "force_measured", "force_trusted"))
TAU_FORCE = tuple(ALL_SAMPLES.index(f"tau_force_{joint}") for joint in (1, 2, 3))
BODY, BODY_RATE, TRAVEL = (_find_columns(WIDE_BODY_SAMPLES, array) for array in ("body", "body_rate", "travel"))
"""Column indices of the body; its position in the world is the planned one unless the plant measures it."""
BODY_MEASURED, BODY_RATE_MEASURED, TRAVEL_MEASURED = (
    _find_columns(WIDE_BODY_SAMPLES, array, "_measured") for array in ("body", "body_rate", "travel")
)


def name_samples(samples: Array, names: tuple[str, ...] = ALL_SAMPLES) -> dict[str, Array]:
    """Map column names to the columns of ``samples`` (columns, ...), in their units.

    ``names`` is ALL_SAMPLES for legs and WIDE_BODY_SAMPLES for the body; extra names are ignored.
    """
    return dict(zip(names, samples, strict=False))


def make_samples(steps: int, legs: int, wide: bool, joints: int = 2) -> tuple[Array, Array]:
    """Allocate zeros for the samples of legs (columns, steps, L) and body (columns, steps).

    ``wide`` adds the columns of altering sensors; legs with three joints always have them. Each column is contiguous,
    since readers process whole columns.
    """
    spatial = joints > 2
    columns = ALL_SAMPLES if spatial else WIDE_SAMPLES if wide else SAMPLES
    return (
        np.zeros((len(columns), steps, legs)),
        np.zeros((len(WIDE_BODY_SAMPLES if wide or spatial else BODY_SAMPLES), steps)),
    )


@kernel
def write_samples(
    samples: Array,
    body_samples: Array,
    k: int,
    travel: Array | None,
    machine: PlantState,
    observation: Observation,
    control: HybridState,
    feedforward: Array,
) -> None:
    """Write step ``k`` of samples (columns, steps, L) and body samples (columns, steps).

    The torques of ``control`` and ``feedforward`` (L, J), N m, are those that act, after the actuator.
    """
    for n in range(3):
        body_samples[BODY[n], k] = machine.body[n]
        if travel is not None:
            body_samples[TRAVEL[n], k] = travel[n]
    for i in range(samples.shape[2]):
        samples[FORCE, k, i] = machine.force[i]
        samples[FORCE_MEASURED, k, i] = observation.force[i]
        for j in range(machine.q.shape[1]):
            samples[FOOT[j], k, i] = machine.foot[i, j]
            samples[VELOCITY[j], k, i] = machine.velocity[i, j]
            samples[Q[j], k, i] = machine.q[i, j]
            samples[DQ[j], k, i] = machine.dq[i, j]
            samples[REFERENCE[j], k, i] = control.reference[i, j]
            samples[TAU_FEEDBACK[j], k, i] = control.feedback[i, j]
            samples[TAU_FEEDFORWARD[j], k, i] = feedforward[i, j]
            if samples.shape[0] > len(WIDE_SAMPLES):
                samples[TAU_FORCE[j], k, i] = control.feedback[i, j] - control.learning_error[i, j]
    if samples.shape[0] > len(SAMPLES):
        write_measured(samples, body_samples, k, observation.travel, machine, observation, control)


@kernel
def write_measured(
    samples: Array,
    body_samples: Array,
    k: int,
    travel: Array | None,
    machine: PlantState,
    observation: Observation,
    control: HybridState,
) -> None:
    """Write the columns of step ``k`` that altering sensors and force fault detection add.

    Units are those of :mod:`cmacexp.data.signals`; ``travel`` (3,) is the measured one, m and rad. Other arguments
    are as for :func:`write_samples`.
    """
    for n in range(3):
        body_samples[BODY_RATE[n], k] = machine.body_rate[n]
        body_samples[BODY_MEASURED[n], k] = observation.body[n]
        body_samples[BODY_RATE_MEASURED[n], k] = observation.body_rate[n]
        if travel is not None:
            body_samples[TRAVEL_MEASURED[n], k] = travel[n]
    for i in range(samples.shape[2]):
        samples[FORCE_TRUSTED, k, i] = control.fault_status.trusted[i]
        for j in range(machine.q.shape[1]):
            samples[FOOT_MEASURED[j], k, i] = observation.foot[i, j]
            samples[VELOCITY_MEASURED[j], k, i] = observation.velocity[i, j]
            samples[Q_MEASURED[j], k, i] = observation.q[i, j]
            samples[DQ_MEASURED[j], k, i] = observation.dq[i, j]


@kernel
def write_drives(samples: Array, k: int, drives: Drives | None) -> None:
    """Write the mean torques that ``drives`` applied in step ``k`` to samples (columns, steps, L), N m.

    The feedback is the torque that the controller sent, which does not train the feedforward, plus the torque of the
    gains of the drives.
    """
    if drives is None:
        return
    acted = drives.acted
    for i in range(samples.shape[2]):
        for j in range(3):
            samples[TAU_FORCE[j], k, i] = acted[TORQUE, i, j]
            samples[TAU_FEEDBACK[j], k, i] = acted[TORQUE, i, j] + acted[DRIVE, i, j]
            samples[TAU_FEEDFORWARD[j], k, i] = acted[FEEDFORWARD, i, j]
