"""Drives of today: between two commands each closes a loop of its own around its joint.

A command is a torque, an angle, a velocity and two gains; the drive gives torque + K (q_d - q) + D (dq_d - dq), many
times in a sampling period. Commands arrive late, jitter, or are lost, and a drive follows the newest that it has.
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from cmacexp.config import number
from cmacexp.config.schema import ActuatorConfig
from cmacexp.jit.compiler import copy_array, kernel
from cmacexp.models.loop_delay import first_order_share
from cmacexp.models.mix import MASK, mix
from cmacexp.typing import Array, Clock, Counts, Role, Scratch, State

TORQUE, FEEDFORWARD, ANGLE, VELOCITY, STIFFNESS, DAMPING = range(6)
"""Parts of a command: torques of controller and feedforward, N m, angle and velocity, rad and rad/s, and the gains,
N m/rad and N m s/rad."""
DRIVE = 2
"""Part of the torque that acts besides TORQUE and FEEDFORWARD: what the gains make of the errors."""
BUS_SEED = 0x42555321
"""Separates the random numbers of the bus from those of other components under the same seed."""


@dataclass(kw_only=True)
class BusConfig:
    """How commands reach the drives, and what these measure, as nothing but the plant knows."""

    needs: ClassVar[tuple[str, ...]] = ("option.controller != 'hybrid'",)

    jitter: float = number("s", at_least=0, at_most=1, default=0.0)
    """Most by which a command is later than ``actuator.delay`` and ``plant.delay`` say, each at random."""
    loss: float = number("", at_least=0, below=1, default=0.0)
    """Probability that a command is lost: the drives follow the one before."""
    velocity_lag: float = number("s", at_least=0, at_most=1, default=0.0)
    """Time constant of the filter by which a drive measures its velocity; 0: none."""
    seed: int = number("", at_least=0, below=2**32, needs=("own.jitter > 0 or own.loss > 0",), default=0)
    """Seed of what is late or lost."""


class Drives(NamedTuple):
    """The drives of L legs with J joints each, the bus to them, and what they did."""

    command: Scratch
    """(6, L, J): of this step, its parts in the order and units of TORQUE to DAMPING."""
    sent: Annotated[Array, Role("state", ring_axis=0)]
    """(R, 6, L, J): commands of the last steps, likewise."""
    due: Annotated[Array, Role("clock", ring_axis=0)]
    """(R,): when each arrives, in inner steps since the start; infinite: never."""
    held: State
    """(6, L, J): command that the drives follow, likewise."""
    used: Clock
    """(1,): step in which it was sent."""
    clock: Clock
    """(1,): inner steps since the start."""
    velocity: State
    """(L, J): velocities as the drives measure them, rad/s."""
    lagged: State
    """(3, L, J): torque of each part, TORQUE, FEEDFORWARD and DRIVE, that acts now, N m."""
    acted: Scratch
    """(3, L, J): its mean over the last sampling period, N m."""
    torque: Scratch
    """(L, J): the sum that acts now, N m."""
    limit: tuple[float, ...]
    """(J,): largest absolute torque, N m."""
    share: float
    """Part of its difference from the law by which a torque changes in an inner step; 1 without a lag."""
    velocity_share: float
    """Part of its difference from the true velocity by which a measured one changes in an inner step; 1: all."""
    substeps: int
    """Inner steps of a sampling period."""
    delay: int
    """Inner steps from a command to its arrival."""
    jitter: float
    """Most that are added to that."""
    loss: float
    """Probability that a command does not arrive."""
    key: int
    """Key of random numbers."""


def new_drives(
    actuator: ActuatorConfig,
    bus: BusConfig,
    sampling_period: float,
    substeps: int,
    limit: tuple[float, ...],
    legs: int,
) -> Drives:
    """Drives at rest, of so many ``legs`` with joints of these limits (J,), N m; they take the first command at once.

    Delay and lag are those of the ``actuator``, whose delay counts samples; ``sampling_period`` in s.
    """
    inner, shape = sampling_period / substeps, (legs, len(limit))
    delay, jitter = actuator.delay * substeps, bus.jitter / inner
    kept = math.ceil((delay + jitter) / substeps) + 2
    return Drives(
        command=np.zeros((6, *shape)),
        sent=np.zeros((kept, 6, *shape)),
        due=np.zeros(kept),
        held=np.zeros((6, *shape)),
        used=np.full(1, -1.0),
        clock=np.zeros(1),
        velocity=np.zeros(shape),
        lagged=np.zeros((3, *shape)),
        acted=np.zeros((3, *shape)),
        torque=np.zeros(shape),
        limit=limit,
        share=first_order_share(actuator.lag, inner),
        velocity_share=first_order_share(bus.velocity_lag, inner),
        substeps=substeps,
        delay=delay,
        jitter=jitter,
        loss=bus.loss,
        key=mix(BUS_SEED, bus.seed),
    )


@kernel
def _draw(key: int, step: int, use: int) -> float:
    """A random number from 0 to below 1, of a ``step``."""
    return mix(mix(key, step), use) / (MASK + 1.0)


@kernel
def send_command(drives: Drives | None, step: int, torque: Array, feedforward: Array) -> None:
    """Send the command of ``step`` with the torques (L, J), N m; steps must follow each other from 0."""
    if drives is None:
        return
    row = step % drives.sent.shape[0]
    copy_array(torque, drives.command[TORQUE])
    copy_array(feedforward, drives.command[FEEDFORWARD])
    copy_array(drives.command, drives.sent[row])
    drives.acted[...] = 0.0
    drives.due[row] = step * drives.substeps + drives.delay + math.floor(drives.jitter * _draw(drives.key, step, 0))
    if drives.loss > 0.0 and _draw(drives.key, step, 1) < drives.loss:
        drives.due[row] = math.inf
    if step == 0:
        drives.due[row] = 0.0


@kernel
def _receive(drives: Drives) -> None:
    """Follow the newest command that has arrived."""
    now = drives.clock[0]
    newest = int(now) // drives.substeps
    used = int(drives.used[0])
    taken = used
    for step in range(max(used + 1, newest + 1 - drives.due.shape[0]), newest + 1):
        if drives.due[step % drives.due.shape[0]] <= now:
            taken = step
    if taken > used:
        drives.used[0] = taken
        copy_array(drives.sent[taken % drives.due.shape[0]], drives.held)


@kernel
def drive_joints(drives: Drives, q: Counts, dq: Counts, position: Array, velocity: Array) -> None:
    """One inner step of all drives: fills ``drives.torque``.

    Joints have the rows ``q`` (L, J) of ``position``, rad, and ``dq`` (L, J) of ``velocity``, rad/s.
    """
    _receive(drives)
    drives.clock[0] += 1.0
    held = drives.held
    lagged = drives.lagged
    for i in range(q.shape[0]):
        for j in range(q.shape[1]):
            drives.velocity[i, j] += drives.velocity_share * (velocity[dq[i, j]] - drives.velocity[i, j])
            law = held[STIFFNESS, i, j] * (held[ANGLE, i, j] - position[q[i, j]])
            law += held[DAMPING, i, j] * (held[VELOCITY, i, j] - drives.velocity[i, j])
            sent = held[TORQUE, i, j] + held[FEEDFORWARD, i, j]
            law = min(max(sent + law, -drives.limit[j]), drives.limit[j]) - sent
            lagged[TORQUE, i, j] += drives.share * (held[TORQUE, i, j] - lagged[TORQUE, i, j])
            lagged[FEEDFORWARD, i, j] += drives.share * (held[FEEDFORWARD, i, j] - lagged[FEEDFORWARD, i, j])
            lagged[DRIVE, i, j] += drives.share * (law - lagged[DRIVE, i, j])
            drives.torque[i, j] = lagged[TORQUE, i, j] + lagged[FEEDFORWARD, i, j] + lagged[DRIVE, i, j]
            for part in range(3):
                drives.acted[part, i, j] += lagged[part, i, j] / drives.substeps
