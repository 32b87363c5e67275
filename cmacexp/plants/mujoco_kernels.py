"""Kernels for machines in MuJoCo: integration steps, external forces and measurements.

Python calls a compiled generator in every step: resuming it costs a tenth of a call of a program with as many
arrays. The caller must keep the arrays alive.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cmacexp.jit.compiler import copy_array, kernel, program
from cmacexp.models.chain import cross
from cmacexp.models.ground import Ground, grade_at, height_at, stiffness_under
from cmacexp.models.mechanism import (
    Mechanism,
    compute_foot_position,
    compute_foot_velocity,
    update_kinematics,
)
from cmacexp.models.mujoco_library import (
    mj_fwdAcceleration,
    mj_integratePos,
    mj_step1,
    mj_step2,
)
from cmacexp.plants.drives import Drives, drive_joints
from cmacexp.plants.instruments import Instruments, read_drives, read_instruments
from cmacexp.plants.kernels import Payload, PlantState
from cmacexp.plants.touch import Joints, Touch, Vector, ground_force, hold_torque, slide_anchor
from cmacexp.typing import Array, Counts


class Push(NamedTuple):
    """Force on the centre of mass of the trunk over some sampling periods."""

    force: float = 0.0
    """Force to the left, N."""
    start: int = 0
    """First sampling period in which it acts."""
    end: int = 0
    """End of the push, exclusive: first sampling period without it."""


NO_PUSH = Push()


class Feet(NamedTuple):
    """Indices of the feet of L legs in MuJoCo's arrays."""

    point: Counts
    """(L,): row of ``Bodies.place``."""
    body: Counts
    """(L,): numbers of the bodies to which they are fixed."""
    root: Counts
    """(L,): numbers of the first bodies of their chains."""
    trunk: int
    """Number of the body with the free joint; for legs on a stand 0, the world."""


class Bodies(NamedTuple):
    """Arrays that MuJoCo fills and reads in place; B is the number of its bodies."""

    place: Array
    """(points, 3): positions of points of bodies in the world, the feet among them, m."""
    motion: Array
    """(B, 6): angular velocity, rad/s, and velocity, m/s, of the point of the body that coincides with ``centre``."""
    centre: Array
    """(B, 3): centre of mass of a body and its descendants, m; velocities refer to that of the root of a chain."""
    mass_centre: Array
    """(B, 3): centre of mass of each body, m, where its external force acts."""
    pull: Array
    """(B, 6): external force (N) and moment (N m)."""
    trunk_place: Array
    """(3,): position of the trunk's frame in the world, m."""
    trunk_rotation: Array
    """(9,): rotation matrix of the trunk's frame, row by row, without a unit."""
    trunk_rate: Array
    """(6,): velocity of the trunk in the world, m/s, and its angular velocity in its own frame, rad/s."""


class Stages(NamedTuple):
    """Intermediate values of a step of the classical Runge-Kutta method."""

    step: float
    """Time step, s."""
    start: Array
    """(nq,): positions at the start of the step, m and rad."""
    mean: Array
    """(nv,): weighted mean of the velocities, m/s and rad/s."""
    velocity: Array
    """(4, nv): velocities of the stages, m/s and rad/s."""
    acceleration: Array
    """(4, nv): accelerations of the stages, m/s^2 and rad/s^2."""


WEIGHTS = ((0.5, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6))
"""Weights of the stages in the mean velocity and acceleration for the next stage, and for the end of the step."""


class Engine(NamedTuple):
    """A machine of L legs in MuJoCo, its environment, and the indices of both in MuJoCo's arrays."""

    model: int
    """Address of MuJoCo's model."""
    data: int
    """Address of MuJoCo's data."""
    substeps: int
    """Steps of MuJoCo per sampling period."""
    stages: Stages | None
    """Stages of Runge-Kutta; None: MuJoCo's semi-implicit Euler."""
    warned: Counts
    """(warnings,): number of times that MuJoCo has given each warning."""
    position: Array
    """(nq,): positions of all joints, m, rad, and quaternions; the next two (nv,), m/s and rad/s, m/s^2 and
    rad/s^2."""
    velocity: Array
    acceleration: Array
    """Acceleration without constraints."""
    torque: Array
    """(nv,): applied generalised forces, N m, for the trunk's translations N."""
    q: Counts
    """(L, J): indices of the joint angles in ``position``."""
    dq: Counts
    """(L, J): indices of the joints in ``velocity`` and ``torque``."""
    bodies: Bodies
    feet: Feet
    origin: Array
    """(3,): origin of the body frame in the frame of the trunk, m."""
    mechanism: Mechanism
    payload: Payload
    push: Push
    touch: Touch
    """Contact of a foot with elastic ground; the height of the body is measured from the surface of that ground."""
    anchor: Array
    """(L, 2): point in the world to which each foot sticks, m."""
    sensors: Array
    """(values,): values of MuJoCo's sensors, in their units."""
    floor: Counts | None
    """(L,): indices in ``sensors`` of the normal forces of MuJoCo's own contacts, N; None: ``touch`` acts instead of
    them."""
    travel: Array | None
    """(3,): world pose, m and rad, as in a Measurement."""
    joints: Joints | None
    """Joint torques in addition to the actuators; None: as in the model."""
    instruments: Instruments | None = None
    """Instruments of a robot."""


@kernel
def foot_velocity(bodies: Bodies, feet: Feet, i: int) -> Vector:
    """Compute the velocity (3,) of foot ``i`` in the world, m/s."""
    point = bodies.place[feet.point[i]]
    motion = bodies.motion[feet.body[i]]
    root = bodies.centre[feet.root[i]]
    dx = point[0] - root[0]
    dy = point[1] - root[1]
    dz = point[2] - root[2]
    return (
        motion[3] + motion[1] * dz - motion[2] * dy,
        motion[4] + motion[2] * dx - motion[0] * dz,
        motion[5] + motion[0] * dy - motion[1] * dx,
    )


@kernel
def pull_at(bodies: Bodies, body: int, point: Array | Vector, force: Vector) -> None:
    """Set the external force on ``body`` to ``force`` (3,), N, at ``point`` (3,), m; it replaces any other."""
    centre = bodies.mass_centre[body]
    moment = cross((point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]), force)
    for n in range(3):
        bodies.pull[body, n] = force[n]
        bodies.pull[body, 3 + n] = moment[n]


@kernel
def press(touch: Touch, bodies: Bodies, feet: Feet, machine: PlantState, anchors: Array, in_stage: bool) -> None:
    """Apply the ground's forces on feet that stick at ``anchors`` (L, 2), m; fill ``bodies.pull`` and ``machine``.

    With ``in_stage`` stiffness and anchors stay those of the start of the integration step.
    """
    for i in range(anchors.shape[0]):
        point = bodies.place[feet.point[i]]
        if not in_stage:
            machine.stiffness[i] = stiffness_under(touch.ground, i, machine.clock[0], point[0], point[1])
        force = ground_force(touch, machine.stiffness[i], point, foot_velocity(bodies, feet, i), anchors[i])
        machine.force[i] = force[2]
        if not in_stage:
            slide_anchor(touch, point, machine.force[i], anchors[i])
        pull_at(bodies, feet.body[i], point, force)


@kernel
def transform_point(at: Array, rotation: Array, x: float, y: float, z: float) -> Vector:
    """Return ``at`` (3,) plus the vector (x, y, z), m or m/s, rotated by the rotation matrix ``rotation`` (9,)."""
    return (
        at[0] + rotation[0] * x + rotation[1] * y + rotation[2] * z,
        at[1] + rotation[3] * x + rotation[4] * y + rotation[5] * z,
        at[2] + rotation[6] * x + rotation[7] * y + rotation[8] * z,
    )


@kernel
def load_trunk(payload: Payload, push: Push, origin: Array, bodies: Bodies, feet: Feet, clock: float) -> None:
    """Apply payload and push, N, to the trunk, in the frame of which the body is at ``origin`` (3,), m."""
    if clock >= payload.start:
        load = payload.load
        point = transform_point(
            bodies.trunk_place, bodies.trunk_rotation, origin[0] + load.x, origin[1] + load.y, origin[2]
        )
        pull_at(bodies, feet.trunk, point, (0.0, 0.0, -load.weight))
    bodies.pull[feet.trunk, 1] = push.force if push.start <= clock < push.end else 0.0


@kernel
def observe_trunk(
    ground: Ground, bodies: Bodies, at: Vector, velocity: Vector, pose: Array, rate: Array, travel: Array | None
) -> None:
    """Measure a body at ``at``, m, with ``velocity``, m/s, (3,) each.

    Fills (3,) each: ``pose``, m and rad, ``rate``, m/s and rad/s, and ``travel``, m and rad.
    """
    rotation = bodies.trunk_rotation
    spin = bodies.trunk_rate[3:]
    pitch, roll = -math.asin(rotation[6]), math.atan2(rotation[7], rotation[8])
    pose[0] = at[2] - height_at(ground.slope, ground.slope_start, at[0])
    pose[1] = pitch
    pose[2] = roll
    rate[0] = velocity[2] - grade_at(ground, at[0]) * velocity[0]
    rate[1] = spin[1] * math.cos(roll) - spin[2] * math.sin(roll)
    rate[2] = spin[0] + (spin[1] * math.sin(roll) + spin[2] * math.cos(roll)) * math.tan(pitch)
    if travel is not None:
        travel[0] = at[0]
        travel[1] = at[1]
        travel[2] = math.atan2(rotation[3], rotation[0])


@kernel
def observe(engine: Engine, machine: PlantState, torque: Array) -> None:
    """Fill ``machine`` with the current state in MuJoCo of a machine whose motors held ``torque`` (L, J), N m."""
    origin = engine.origin
    bodies = engine.bodies
    rotation = bodies.trunk_rotation
    spin = bodies.trunk_rate[3:]
    at = transform_point(bodies.trunk_place, rotation, origin[0], origin[1], origin[2])
    velocity = transform_point(
        bodies.trunk_rate,
        rotation,
        spin[1] * origin[2] - spin[2] * origin[1],
        spin[2] * origin[0] - spin[0] * origin[2],
        spin[0] * origin[1] - spin[1] * origin[0],
    )
    for i in range(machine.q.shape[0]):
        for j in range(machine.q.shape[1]):
            machine.q[i, j] = engine.position[engine.q[i, j]]
            machine.dq[i, j] = engine.velocity[engine.dq[i, j]]
    if engine.feet.trunk > 0:
        observe_trunk(engine.touch.ground, bodies, at, velocity, machine.body, machine.body_rate, engine.travel)
        read_instruments(engine.instruments, machine, torque, engine.travel, rotation, spin, velocity)
    update_kinematics(engine.mechanism, machine.q, machine.kinematics)
    for i in range(machine.q.shape[0]):
        compute_foot_position(engine.mechanism, i, machine.kinematics, machine.foot)
        compute_foot_velocity(engine.mechanism, i, machine.kinematics, machine.dq, machine.velocity)


@kernel
def read_floor(floor: Counts | None, sensors: Array, force: Array) -> None:
    """Fill ``force`` (L,), N, with ``sensors[floor]``, the normal forces of MuJoCo's contacts in the last step."""
    if floor is not None:
        for i in range(force.shape[0]):
            force[i] = sensors[floor[i]]


@kernel
def apply_forces(floor: Counts | None, engine: Engine, machine: PlantState, in_stage: bool) -> None:
    """Apply the ground, unless MuJoCo has a ``floor`` (L,), and the loads of the trunk, N.

    See :func:`press` and :func:`load_trunk`.
    """
    if floor is None:
        press(engine.touch, engine.bodies, engine.feet, machine, engine.anchor, in_stage)
    load_trunk(engine.payload, engine.push, engine.origin, engine.bodies, engine.feet, machine.clock[0])


@kernel
def average(values: Array, stage: int, n: int) -> float:
    """Return the mean, in their unit, of column ``n`` of ``values`` (4, nv) with the weights after ``stage``."""
    a, b, c, d = WEIGHTS[stage]
    return a * values[0, n] + b * values[1, n] + c * values[2, n] + d * values[3, n]


@kernel
def integrate(stages: Stages | None, engine: Engine, machine: PlantState) -> None:
    """Integrate one step of MuJoCo: Euler with ground forces at its start, or Runge-Kutta with those in every stage.

    Ground forces held over a step of Runge-Kutta would excite oscillations of the ground.
    """
    if stages is None:
        mj_step2(engine.model, engine.data)
        read_floor(engine.floor, engine.sensors, machine.force)
        mj_step1(engine.model, engine.data)
    else:
        copy_array(engine.position, stages.start)
        for stage in range(4):
            if engine.warned.any():
                break
            apply_forces(engine.floor, engine, machine, True)
            mj_fwdAcceleration(engine.model, engine.data)
            for n in range(stages.mean.shape[0]):
                stages.velocity[stage, n] = engine.velocity[n]
                stages.acceleration[stage, n] = engine.acceleration[n]
                stages.mean[n] = average(stages.velocity, stage, n)
                engine.velocity[n] = stages.velocity[0, n] + average(stages.acceleration, stage, n) * stages.step
            copy_array(stages.start, engine.position)
            mj_integratePos(engine.model, engine.position.ctypes.data, stages.mean.ctypes.data, stages.step)
            mj_step1(engine.model, engine.data)


@kernel
def advance_engine(engine: Engine, machine: PlantState, torque: Array, drives: Drives | None) -> None:
    """Hold ``torque`` (L, J), N m, over one sampling period; with ``drives``, hold their torques instead.

    Joint angles become NaN if MuJoCo warns.
    """
    held = torque
    for substep in range(engine.substeps):
        if drives is not None:
            drive_joints(drives, engine.q, engine.dq, engine.position, engine.velocity)
            held = drives.torque
        hold_torque(engine.joints, held, engine.q, engine.dq, engine.position, engine.torque)
        integrate(engine.stages, engine, machine)
        if engine.warned.any():
            break
        if substep + 1 == engine.substeps:
            machine.clock[0] += 1
        apply_forces(engine.floor, engine, machine, False)
    if engine.warned.any():
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                machine.q[i, j] = math.nan
    else:
        observe(engine, machine, torque)
        read_drives(engine.instruments, drives)


@program
def advancing(engine: Engine, machine: PlantState, torque: Array) -> Iterator[int]:
    """Call :func:`advance_engine` with the current ``torque`` (L, J), N m, whenever it is resumed."""
    while True:
        advance_engine(engine, machine, torque, None)
        yield 0
