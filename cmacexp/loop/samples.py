"""Samples of every step, in the columns of the table of signals."""

import numpy as np

from cmacexp.control.hybrid_kernels import HybridState
from cmacexp.data.signals import ARRAYS, BODY_SIGNALS, LEG_SIGNALS, SPATIAL_SIGNALS, list_samples
from cmacexp.jit.compiler import kernel
from cmacexp.plants.drives import DRIVE, FEEDFORWARD, TORQUE, Drives
from cmacexp.plants.kernels import PlantState
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import Array

SAMPLES, BODY_SAMPLES = (list_samples(table, wide=False) for table in (LEG_SIGNALS, BODY_SIGNALS))
"""Columns that every run samples of each leg, and of a body."""
WIDE_SAMPLES, WIDE_BODY_SAMPLES = (list_samples(table, wide=True) for table in (LEG_SIGNALS, BODY_SIGNALS))
"""The same, followed by those that sensors may add."""
ALL_SAMPLES = WIDE_SAMPLES + list_samples(SPATIAL_SIGNALS, wide=True)
"""The same, followed by those of legs that move in space."""


def _columns(names: str) -> tuple[int, ...]:
    return tuple(ALL_SAMPLES.index(name) for name in names.split())


def _body_columns(names: str) -> tuple[int, ...]:
    return tuple(WIDE_BODY_SAMPLES.index(name) for name in names.split())


X, Y, VX, VY, Q1, Q2, DQ1, DQ2 = _columns("x y vx vy q1 q2 dq1 dq2")
X_MEASURED, Y_MEASURED, VX_MEASURED, VY_MEASURED = _columns("x_measured y_measured vx_measured vy_measured")
Q1_MEASURED, Q2_MEASURED, DQ1_MEASURED, DQ2_MEASURED = _columns("q1_measured q2_measured dq1_measured dq2_measured")
FORCE, FORCE_MEASURED, FORCE_TRUSTED = _columns("force force_measured force_trusted")
X_REFERENCE, Y_REFERENCE = _columns("x_reference y_reference")
TAU_FEEDBACK_1, TAU_FEEDBACK_2 = _columns("tau_feedback_1 tau_feedback_2")
TAU_FEEDFORWARD_1, TAU_FEEDFORWARD_2 = _columns("tau_feedforward_1 tau_feedforward_2")
Z, VZ, Q3, DQ3, Z_REFERENCE = _columns("z vz q3 dq3 z_reference")
Z_MEASURED, VZ_MEASURED, Q3_MEASURED, DQ3_MEASURED = _columns("z_measured vz_measured q3_measured dq3_measured")
TAU_FEEDBACK_3, TAU_FEEDFORWARD_3 = _columns("tau_feedback_3 tau_feedforward_3")
TAU_FORCE_1, TAU_FORCE_2, TAU_FORCE_3 = _columns("tau_force_1 tau_force_2 tau_force_3")
HEIGHT, PITCH, ROLL = _body_columns("height pitch roll")
HEIGHT_RATE, PITCH_RATE, ROLL_RATE = _body_columns("height_rate pitch_rate roll_rate")
HEIGHT_MEASURED, PITCH_MEASURED, ROLL_MEASURED = _body_columns("height_measured pitch_measured roll_measured")
HEIGHT_RATE_MEASURED, PITCH_RATE_MEASURED, ROLL_RATE_MEASURED = _body_columns(
    "height_rate_measured pitch_rate_measured roll_rate_measured"
)
COG_X, COG_Y, YAW = TRAVEL = [BODY_SAMPLES.index(name) for name in ARRAYS["travel"]]
"""Columns of the position of the body in the world; those of the plan unless the plant measures them."""
COG_X_MEASURED, COG_Y_MEASURED, YAW_MEASURED = _body_columns("cog_x_measured cog_y_measured yaw_measured")


def name_samples(samples: Array, names: tuple[str, ...] = ALL_SAMPLES) -> dict[str, Array]:
    """Columns (...) of samples (..., columns) by name, in their units; ``names`` of a body are WIDE_BODY_SAMPLES."""
    return {name: samples[..., column] for column, name in enumerate(names[: samples.shape[-1]])}


def make_samples(steps: int, legs: int, wide: bool, joints: int = 2) -> tuple[Array, Array]:
    """Zeros for the samples of legs (steps, L, columns) and body (steps, columns); with a third joint always wide."""
    spatial = joints > 2
    columns = ALL_SAMPLES if spatial else WIDE_SAMPLES if wide else SAMPLES
    return (
        np.zeros((steps, legs, len(columns))),
        np.zeros((steps, len(WIDE_BODY_SAMPLES if wide or spatial else BODY_SAMPLES))),
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
    """Write row ``k`` of samples (steps, L, columns) and body samples (steps, columns).

    The torques are those that act: of ``control`` and ``feedforward`` (L, J), N m, after the actuator.
    """
    body = machine.body
    body_samples[k, HEIGHT] = body[0]
    body_samples[k, PITCH] = body[1]
    body_samples[k, ROLL] = body[2]
    if travel is not None:
        body_samples[k, COG_X] = travel[0]
        body_samples[k, COG_Y] = travel[1]
        body_samples[k, YAW] = travel[2]
    for i in range(samples.shape[1]):
        row = samples[k, i]
        row[X], row[Y] = machine.foot[i, 0], machine.foot[i, 1]
        row[VX], row[VY] = machine.velocity[i, 0], machine.velocity[i, 1]
        row[Q1], row[Q2] = machine.q[i, 0], machine.q[i, 1]
        row[DQ1], row[DQ2] = machine.dq[i, 0], machine.dq[i, 1]
        row[FORCE], row[FORCE_MEASURED] = machine.force[i], observation.force[i]
        row[X_REFERENCE], row[Y_REFERENCE] = control.reference[i, 0], control.reference[i, 1]
        row[TAU_FEEDBACK_1], row[TAU_FEEDBACK_2] = control.feedback[i, 0], control.feedback[i, 1]
        row[TAU_FEEDFORWARD_1], row[TAU_FEEDFORWARD_2] = feedforward[i, 0], feedforward[i, 1]
    if samples.shape[2] > len(SAMPLES):
        write_measured(samples, body_samples, k, machine, observation, control)
        write_measured_travel(body_samples, k, observation.travel)
    if samples.shape[2] > len(WIDE_SAMPLES):
        write_spatial(samples, k, machine, observation, control, feedforward)


@kernel
def write_measured(
    samples: Array, body_samples: Array, k: int, machine: PlantState, observation: Observation, control: HybridState
) -> None:
    """Write the columns that sensors and their supervision add, of row ``k`` of (K, L, columns) and (K, columns).

    Like all columns they are in the units of :mod:`cmacexp.data.signals`.
    """
    for i in range(samples.shape[1]):
        row = samples[k, i]
        row[X_MEASURED], row[Y_MEASURED] = observation.foot[i, 0], observation.foot[i, 1]
        row[VX_MEASURED], row[VY_MEASURED] = observation.velocity[i, 0], observation.velocity[i, 1]
        row[Q1_MEASURED], row[Q2_MEASURED] = observation.q[i, 0], observation.q[i, 1]
        row[DQ1_MEASURED], row[DQ2_MEASURED] = observation.dq[i, 0], observation.dq[i, 1]
        row[FORCE_TRUSTED] = control.fault_status.trusted[i]
    row = body_samples[k]
    true = machine.body_rate
    body = observation.body
    rate = observation.body_rate
    row[HEIGHT_RATE] = true[0]
    row[PITCH_RATE] = true[1]
    row[ROLL_RATE] = true[2]
    row[HEIGHT_MEASURED] = body[0]
    row[PITCH_MEASURED] = body[1]
    row[ROLL_MEASURED] = body[2]
    row[HEIGHT_RATE_MEASURED] = rate[0]
    row[PITCH_RATE_MEASURED] = rate[1]
    row[ROLL_RATE_MEASURED] = rate[2]


@kernel
def write_measured_travel(body_samples: Array, k: int, travel: Array | None) -> None:
    """Write the measured place and heading ``travel`` (3,), m and rad, of row ``k`` of (K, columns), if any."""
    if travel is not None:
        row = body_samples[k]
        row[COG_X_MEASURED] = travel[0]
        row[COG_Y_MEASURED] = travel[1]
        row[YAW_MEASURED] = travel[2]


@kernel
def write_spatial(
    samples: Array,
    k: int,
    machine: PlantState,
    observation: Observation,
    control: HybridState,
    feedforward: Array,
) -> None:
    """Write the columns that legs with a third joint add, of row ``k`` of (K, L, columns); torques (L, 3) in N m."""
    for i in range(samples.shape[1]):
        row, learning_error = samples[k, i], control.learning_error
        row[Z], row[VZ] = machine.foot[i, 2], machine.velocity[i, 2]
        row[Q3], row[DQ3] = machine.q[i, 2], machine.dq[i, 2]
        row[Z_MEASURED], row[VZ_MEASURED] = observation.foot[i, 2], observation.velocity[i, 2]
        row[Q3_MEASURED], row[DQ3_MEASURED] = observation.q[i, 2], observation.dq[i, 2]
        row[Z_REFERENCE] = control.reference[i, 2]
        row[TAU_FEEDBACK_3], row[TAU_FEEDFORWARD_3] = control.feedback[i, 2], feedforward[i, 2]
        row[TAU_FORCE_1] = control.feedback[i, 0] - learning_error[i, 0]
        row[TAU_FORCE_2] = control.feedback[i, 1] - learning_error[i, 1]
        row[TAU_FORCE_3] = control.feedback[i, 2] - learning_error[i, 2]


@kernel
def write_drives(samples: Array, k: int, drives: Drives | None) -> None:
    """Write what ``drives`` gave in the step of row ``k`` of samples (K, L, columns), in their mean, N m.

    Their feedback is the torque that the controller sent, which does not teach, and what the gains add.
    """
    if drives is None:
        return
    for i in range(samples.shape[1]):
        row, acted = samples[k, i], drives.acted
        row[TAU_FORCE_1], row[TAU_FORCE_2], row[TAU_FORCE_3] = (
            acted[TORQUE, i, 0],
            acted[TORQUE, i, 1],
            acted[TORQUE, i, 2],
        )
        row[TAU_FEEDBACK_1] = acted[TORQUE, i, 0] + acted[DRIVE, i, 0]
        row[TAU_FEEDBACK_2] = acted[TORQUE, i, 1] + acted[DRIVE, i, 1]
        row[TAU_FEEDBACK_3] = acted[TORQUE, i, 2] + acted[DRIVE, i, 2]
        row[TAU_FEEDFORWARD_1] = acted[FEEDFORWARD, i, 0]
        row[TAU_FEEDFORWARD_2] = acted[FEEDFORWARD, i, 1]
        row[TAU_FEEDFORWARD_3] = acted[FEEDFORWARD, i, 2]
