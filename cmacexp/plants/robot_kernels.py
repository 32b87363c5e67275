"""Contact forces on the feet of a robot in MuJoCo, and measurements of it, as kernels that generators resume."""

from collections.abc import Iterator
from typing import NamedTuple

from cmacexp.jit.compiler import kernel, program
from cmacexp.models.ground import Ground, stiffness_under
from cmacexp.models.mechanism import Mechanism, move_foot, place_foot, update_geometry
from cmacexp.plants.kernels import Payload
from cmacexp.plants.mujoco_kernels import Measured, Touch, drag, ground_force, observe_trunk
from cmacexp.typing import Array, Counts


class Feet(NamedTuple):
    """Where the feet stand in MuJoCo's arrays; L legs."""

    geom: Counts
    """(L,)."""
    body: Counts
    """(L,): the bodies to which they are fixed."""
    trunk: int
    """Body with the free joint."""


class RobotBodies(NamedTuple):
    """Arrays that MuJoCo fills and reads in place; B is the number of its bodies, G that of its geoms."""

    place: Array
    """(G, 3): centres of the geoms in the world, m."""
    motion: Array
    """(B, 6): angular velocity, rad/s, and velocity, m/s, of the point of the body that is at ``centre``."""
    centre: Array
    """(B, 3): of mass of a body and its descendants, m; velocities refer to that of the trunk."""
    mass_centre: Array
    """(B, 3): of mass of each body, m, where its external force acts."""
    pull: Array
    """(B, 6): external force (N) and moment (N m)."""
    trunk_place: Array
    """(3,): of the trunk's frame in the world, m."""
    trunk_turn: Array
    """(9,): its rotation matrix, row by row."""
    trunk_rate: Array
    """(6,): its velocity in the world, m/s, and its angular velocity in its own frame, rad/s."""


class Room(NamedTuple):
    """Working memory."""

    load: Array
    """(3,): where the payload acts."""
    origin: Array
    """(2, 3): place and velocity of the body's origin in the world."""
    geometry: Array
    """(L, 12): see :func:`cmacexp.models.mechanism.update_geometry`."""


class Contacts(NamedTuple):
    """State of the contacts of L feet."""

    stiffness: Array
    """(L,): K_n under each foot, N/m."""
    force: Array
    """(L,): normal forces, N."""
    anchor: Array
    """(L, 2): where each foot sticks in the world, m."""
    clock: Array
    """(1,): number of sampling periods since the start."""


@kernel
def pull_at(bodies: RobotBodies, body: int, place: Array, x: float, y: float, z: float) -> None:
    """Let a force, N, act on ``body`` at ``place`` (3,), m, and nothing else."""
    pull, centre = bodies.pull[body], bodies.mass_centre[body]
    dx, dy, dz = place[0] - centre[0], place[1] - centre[1], place[2] - centre[2]
    pull[0], pull[1], pull[2] = x, y, z
    pull[3], pull[4], pull[5] = dy * z - dz * y, dz * x - dx * z, dx * y - dy * x


@kernel
def press_robot(touch: Touch, bodies: RobotBodies, feet: Feet, contacts: Contacts) -> None:
    """Forces of the ground on the feet: fills ``contacts`` and ``bodies.pull``."""
    root = bodies.centre[feet.trunk]
    for i in range(contacts.force.shape[0]):
        place, motion = bodies.place[feet.geom[i]], bodies.motion[feet.body[i]]
        dx, dy, dz = place[0] - root[0], place[1] - root[1], place[2] - root[2]
        velocity = (
            motion[3] + motion[1] * dz - motion[2] * dy,
            motion[4] + motion[2] * dx - motion[0] * dz,
            motion[5] + motion[0] * dy - motion[1] * dx,
        )
        contacts.stiffness[i] = stiffness_under(touch.ground, i, contacts.clock[0], place[0], place[1])
        x, y, z = ground_force(touch, contacts.stiffness[i], place, velocity, contacts.anchor[i])
        contacts.force[i] = z
        drag(touch, place, z, contacts.anchor[i])
        pull_at(bodies, feet.body[i], place, x, y, z)


@kernel
def load_robot(payload: Payload, origin: Array, bodies: RobotBodies, feet: Feet, clock: float, point: Array) -> None:
    """Let the payload act on the trunk, once it is there; ``point`` (3,) is working memory."""
    if clock >= payload.start:
        turn, load = bodies.trunk_turn, payload.load
        ahead, aside, up = origin[0] + load.x, origin[1] + load.y, origin[2]
        for n in range(3):
            point[n] = bodies.trunk_place[n] + turn[3 * n] * ahead + turn[3 * n + 1] * aside + turn[3 * n + 2] * up
        pull_at(bodies, feet.trunk, point, 0.0, 0.0, -load.weight)


@kernel
def observe_robot(
    mechanism: Mechanism,
    ground: Ground,
    bodies: RobotBodies,
    origin: Array,
    q: Array,
    dq: Array,
    room: Room,
    measured: Measured,
) -> None:
    """Measure body and feet of a robot; fills ``measured``.

    Args:
        mechanism: of the robot.
        ground: reference of the height of the body.
        bodies: with present positions and velocities.
        origin: (3,): of the body's frame in that of the trunk, m.
        q: (L, 3): joint angles, rad.
        dq: (L, 3): joint velocities, rad/s.
        room: is filled.
        measured: is filled.
    """
    turn, spin, point, geometry = bodies.trunk_turn, bodies.trunk_rate[3:], room.origin, room.geometry
    moved = (
        spin[1] * origin[2] - spin[2] * origin[1],
        spin[2] * origin[0] - spin[0] * origin[2],
        spin[0] * origin[1] - spin[1] * origin[0],
    )
    for n in range(3):
        a, b, c = turn[3 * n], turn[3 * n + 1], turn[3 * n + 2]
        point[0, n] = bodies.trunk_place[n] + a * origin[0] + b * origin[1] + c * origin[2]
        point[1, n] = bodies.trunk_rate[n] + a * moved[0] + b * moved[1] + c * moved[2]
    observe_trunk(ground, point[0], turn, point[1], spin, measured)
    update_geometry(mechanism, q, geometry)
    for i in range(q.shape[0]):
        place_foot(mechanism, i, geometry, measured.foot)
        move_foot(mechanism, i, geometry, dq, measured.velocity)


@program
def pressing_robot(
    touch: Touch | None,
    payload: Payload,
    origin: Array,
    bodies: RobotBodies,
    feet: Feet,
    contacts: Contacts,
    room: Room,
) -> Iterator[int]:
    """:func:`press_robot` and :func:`load_robot` whenever it is resumed."""
    while True:
        if touch is not None:
            press_robot(touch, bodies, feet, contacts)
        load_robot(payload, origin, bodies, feet, contacts.clock[0], room.load)
        yield 0


@program
def observing_robot(
    mechanism: Mechanism,
    ground: Ground,
    bodies: RobotBodies,
    origin: Array,
    q: Array,
    dq: Array,
    room: Room,
    measured: Measured,
) -> Iterator[int]:
    """:func:`observe_robot` whenever it is resumed."""
    while True:
        observe_robot(mechanism, ground, bodies, origin, q, dq, room, measured)
        yield 0
