"""Drives that close a loop of their own around each joint, between two commands.

A command is a torque, an angle, a velocity and two gains; the drive gives torque + K (q_d - q) + D (dq_d - dq), many
times in a sampling period or, as simulators of robots do, once a command. Commands arrive with delay and jitter, or
are lost; a drive follows the newest that has arrived.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from cmacexp.config import number
from cmacexp.config.schema import ActuatorConfig
from cmacexp.jit.compiler import copy_array, kernel
from cmacexp.models.loop_delay import first_order_share
from cmacexp.models.mix import MASK, mix
from cmacexp.typing import Array, Clock, Counts, Role, Scratch, State

TORQUE, FEEDFORWARD, ANGLE, VELOCITY, STIFFNESS, DAMPING = range(6)
"""Rows of a command: torques of controller and feedforward, N m, angle and velocity, rad and rad/s, and the gains, N
m/rad and N m s/rad."""
DRIVE = 2
"""Row of the torque from gains and errors, which acts in addition to TORQUE and FEEDFORWARD."""
BUS_SEED = 0x42555321
"""Separates the random numbers of the bus from those of other components under the same seed."""


@dataclass(kw_only=True)
class ReceiverConfig:
    """How the receiver of commands computes the torques of the drives; gains by rule count it."""

    sampled: bool = field(default=False)
    """True: once for each command, from readings up to one sampling period old, and held until the next command.
    False: many times in a sampling period, as in the motors of a robot."""


@dataclass(kw_only=True)
class BusConfig(ReceiverConfig):
    """Transmission of commands to the drives and their measurement of velocity, known to the plant only."""

    needs: ClassVar[tuple[str, ...]] = ("option.controller != 'hybrid'",)

    jitter: float = number("s", at_least=0, at_most=1, default=0.0)
    """Largest additional delay of a command beyond ``actuator.delay`` and ``plant.delay``, random for each
    command."""
    loss: float = number("", at_least=0, below=1, default=0.0)
    """Probability that a command is lost: the drives then follow the previous one."""
    velocity_lag: float = number("s", at_least=0, at_most=1, default=0.0)
    """Time constant of the filter in a drive's measurement of velocity; 0: none."""
    seed: int = number("", at_least=0, below=2**32, needs=("own.jitter > 0 or own.loss > 0",), default=0)
    """Seed of jitter and loss."""


class Drives(NamedTuple):
    """Drives of L legs with J joints each, the bus to them, and the torques that acted."""

    command: Scratch
    """(6, L, J): command of this step, in the order and units of TORQUE to DAMPING."""
    sent: Annotated[Array, Role("state", ring_axis=0)]
    """(R, 6, L, J): commands of the last steps, in the same order and units."""
    due: Annotated[Array, Role("clock", ring_axis=0)]
    """(R,): time of arrival of each, in inner steps since the start; infinite: never."""
    held: State
    """(6, L, J): command that the drives follow, in the same order and units."""
    used: Clock
    """(1,): step in which that command was sent."""
    clock: Clock
    """(1,): number of inner steps since the start."""
    velocity: State
    """(L, J): velocities as measured by the drives, rad/s."""
    sampled: bool
    """True if the law is computed once a command."""
    readings: State
    """(2, L, J): angles, rad, and velocities, rad/s, at the last beginning of a sampling period."""
    law: State
    """(L, J): torque of the law at the last command, N m, of drives that compute once a command."""
    lagged: State
    """(3, L, J): torques behind the lag, of TORQUE, FEEDFORWARD and DRIVE, N m."""
    acted: Scratch
    """(3, L, J): mean of ``lagged`` over the last sampling period, N m."""
    torque: Scratch
    """(L, J): total torque, the sum of ``lagged``, N m."""
    limit: tuple[float, ...]
    """(J,): largest absolute torque, N m."""
    share: float
    """Fraction of its difference from the law by which a torque changes in an inner step; 1 without a lag."""
    velocity_share: float
    """Fraction of its difference from the true velocity by which the measured one changes in an inner step; 1 without
    a lag."""
    substeps: int
    """Inner steps per sampling period."""
    delay: int
    """Delay of a command, inner steps."""
    jitter: float
    """Largest additional delay, inner steps."""
    loss: float
    """Probability that a command is lost."""
    key: int
    """Key of the random numbers."""


def new_drives(
    actuator: ActuatorConfig,
    bus: BusConfig,
    sampling_period: float,
    substeps: int,
    limit: tuple[float, ...],
    legs: int,
) -> Drives:
    """Make drives at rest for ``legs`` legs with joints of torque limits ``limit`` (J,), N m.

    They follow the first command at once. Delay, in samples, and lag are those of the ``actuator``;
    ``sampling_period`` is in s, ``substeps`` the number of inner steps in it.
    """
    inner = sampling_period / substeps
    shape = (legs, len(limit))
    delay = actuator.delay * substeps
    jitter = bus.jitter / inner
    kept = math.ceil((delay + jitter) / substeps) + 2
    return Drives(
        command=np.zeros((6, *shape)),
        sent=np.zeros((kept, 6, *shape)),
        due=np.zeros(kept),
        held=np.zeros((6, *shape)),
        used=np.full(1, -1.0),
        clock=np.zeros(1),
        velocity=np.zeros(shape),
        sampled=bus.sampled,
        readings=np.zeros((2, *shape)),
        law=np.zeros(shape),
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
    """Draw a random number from [0, 1) for a ``step``; different ``use`` gives independent numbers."""
    return mix(mix(key, step), use) / (MASK + 1.0)


@kernel
def send_command(drives: Drives | None, step: int, torque: Array, feedforward: Array) -> None:
    """Send the command of ``step`` with torques (L, J), N m; call it for consecutive steps from 0."""
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
def _receive(drives: Drives) -> bool:
    """Switch to the newest command that has arrived; return True if there is one."""
    now = drives.clock[0]
    newest = int(now) // drives.substeps
    used = int(drives.used[0])
    arrived = used
    for step in range(max(used + 1, newest + 1 - drives.due.shape[0]), newest + 1):
        if drives.due[step % drives.due.shape[0]] <= now:
            arrived = step
    if arrived > used:
        drives.used[0] = arrived
        copy_array(drives.sent[arrived % drives.due.shape[0]], drives.held)
    return arrived > used


@kernel
def drive_joints(drives: Drives, q: Counts, dq: Counts, position: Array, velocity: Array) -> None:
    """Advance all drives by an inner step and fill ``drives.torque``.

    Joints have the rows ``q`` (L, J) of ``position``, rad, and ``dq`` (L, J) of ``velocity``, rad/s.
    """
    is_new = _receive(drives)
    is_first = drives.clock[0] == 0.0  # nothing is older than the first readings
    begins = int(drives.clock[0]) % drives.substeps == 0
    drives.clock[0] += 1.0
    held = drives.held
    readings = drives.readings
    lagged = drives.lagged
    for i in range(q.shape[0]):
        for j in range(q.shape[1]):
            drives.velocity[i, j] += drives.velocity_share * (velocity[dq[i, j]] - drives.velocity[i, j])
            angle = position[q[i, j]]
            rate = drives.velocity[i, j]
            if drives.sampled and not is_first:
                angle, rate = readings[0, i, j], readings[1, i, j]
            law = held[STIFFNESS, i, j] * (held[ANGLE, i, j] - angle)
            law += held[DAMPING, i, j] * (held[VELOCITY, i, j] - rate)
            if drives.sampled:
                drives.law[i, j] = law if is_new else drives.law[i, j]
                law = drives.law[i, j]
                if begins:
                    readings[0, i, j], readings[1, i, j] = position[q[i, j]], drives.velocity[i, j]
            sent = held[TORQUE, i, j] + held[FEEDFORWARD, i, j]
            law = min(max(sent + law, -drives.limit[j]), drives.limit[j]) - sent
            lagged[TORQUE, i, j] += drives.share * (held[TORQUE, i, j] - lagged[TORQUE, i, j])
            lagged[FEEDFORWARD, i, j] += drives.share * (held[FEEDFORWARD, i, j] - lagged[FEEDFORWARD, i, j])
            lagged[DRIVE, i, j] += drives.share * (law - lagged[DRIVE, i, j])
            drives.torque[i, j] = lagged[TORQUE, i, j] + lagged[FEEDFORWARD, i, j] + lagged[DRIVE, i, j]
            for source in range(3):
                drives.acted[source, i, j] += lagged[source, i, j] / drives.substeps
