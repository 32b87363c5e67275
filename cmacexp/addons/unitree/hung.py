"""Motions before a robot stands: check of its joints, wait for the ground; chirp, and learning of one leg."""

import time
from collections.abc import Callable

import numpy as np

from cmacexp.addons.unitree.link import Gains, Link
from cmacexp.addons.unitree.states import Unsafe, name_joint
from cmacexp.cmac import Cmac
from cmacexp.models.robot import Robot, load_mujoco
from cmacexp.protocols import RobotSignals
from cmacexp.typing import Array

SOFT: Gains = (40.0, 2.0)
"""Gains while the joints of a robot that hangs are checked."""
SLACK: Gains = (20.0, 1.5)
"""Gains during a chirp, so low that friction shows as a tracking error."""
WIGGLE = 0.1
"""Commanded motion of a joint in its check, rad."""
ANSWERED = 0.04
"""Least measured motion of that joint, rad."""
CROSSTALK = 0.04
"""Largest measured motion of any other joint, rad."""
TOUCHED = 0.025
"""Least measured motion of that joint if the robot lies on the ground, with friction, rad."""
CARRIED_ALONG = 1.5
"""Largest measured motion of any other joint over that of this one then, since the trunk moves too."""
CALF = 2
"""Number of the calf among the joints of a leg."""
OFF = 0.8
"""Largest difference of the measured holding torque from the model, N m."""
MOVE = 2.0
"""Duration of a motion to the initial pose, s."""
SETTLES = 1.0
"""Time in which a robot comes to rest under the gains of walking, which rise meanwhile, s."""
HOLD = 0.25
"""Duration of each motion in the check of a joint, s."""
CARRIED = 0.5
"""Part of its weight on the feet above which a robot counts as standing."""
SWING = np.array([0.6, 0.7, -0.9])
"""Peak-to-peak motion of hip, thigh and calf in a chirp, from the standing pose on, rad."""
SLOWEST, FASTEST, STROKES = 2.9, 0.7, 12
"""Periods of the first and the last stroke of a chirp, s, and their number."""
LEARNT_STROKE = 1.5
"""Duration of a stroke of a leg that learns, s."""
LEARNT_STROKES = 20
"""Number of these strokes."""
MOST_LEARNT = 5.0
"""Limit of the learnt feedforward torque of a leg that hangs, N m."""


def find_holding_torque(robot: Robot, stand: Array) -> Array:
    """Return the torques (4, 3), N m, that hold the legs of a level robot in the air at ``stand`` (4, 3), rad."""
    data = robot.at(stand)
    load_mujoco().mj_forward(robot.model, data)
    return np.array(data.qfrc_bias[robot.legs.dof])


def _nudge(link: Link, pose: Array, leg: int, joint: int, angle: float, gains: Gains) -> Array:
    """Move a joint by ``angle``, rad, from a ``pose`` (4, 3), rad, and back; return the motion (4, 3), rad."""
    before = link.signals.q
    goal = pose.copy()
    goal[leg, joint] += angle
    link.move(goal, HOLD, gains)
    moves = link.signals.q - before
    link.move(pose, HOLD, gains)
    return moves


def check_joints(link: Link, stand: Array, expected: Array) -> None:
    """Move each joint a little up and down, and check its motion, and the torque that holds it, against the model.

    ``stand`` (4, 3), rad, is the pose, ``expected`` (4, 3), N m, the torque that holds it. Friction has opposite
    signs after motions up and down, and cancels in their mean, except at the calf, where it varies too much: the
    holding torque of the calf is not checked, and a calf with the wrong sign shows as an angle outside of its range.
    Raises Unsafe.
    """
    link.move(stand, MOVE, SOFT)
    for leg, joint in np.ndindex(stand.shape):
        held = 0.0
        for angle in (WIGGLE, -WIGGLE):
            moved = _nudge(link, stand, leg, joint, angle, SOFT) * np.sign(angle)
            link.move(stand, HOLD, SOFT)  # until it is at rest
            held += 0.5 * float(link.signals.torque[leg, joint])
            crosstalk = np.delete(np.abs(moved), leg * stand.shape[1] + joint).max()
            Unsafe.unless(
                moved[leg, joint] >= ANSWERED and crosstalk <= CROSSTALK,
                f"{name_joint(leg, joint)}, asked for {WIGGLE:g} rad, moved by {moved[leg, joint]:.2g} rad, "
                f"the others by up to {crosstalk:.2g}",
            )
        Unsafe.unless(
            joint == CALF or abs(held - expected[leg, joint]) <= OFF,
            f"{name_joint(leg, joint)} holds {held:.2g} N m, by the model {expected[leg, joint]:.2g}: "
            "does the robot hang, and are order and signs of the joints right?",
        )


def touch_joints(link: Link, crouch: Array, gains: Gains) -> None:
    """Move each joint of a robot that lies a little and back, and check that it moves, and no other one instead.

    ``crouch`` (4, 3), rad, is the pose, ``gains`` are those of walking. Raises Unsafe.
    """
    link.move(crouch, SETTLES, gains)
    for leg, joint in np.ndindex(crouch.shape):
        moves = _nudge(link, crouch, leg, joint, WIGGLE, gains)
        moved = float(moves[leg, joint])
        most = float(np.abs(moves).max())
        Unsafe.unless(
            moved >= TOUCHED and most <= CARRIED_ALONG * moved,
            f"{name_joint(leg, joint)}, asked for {WIGGLE:g} rad, moved by {moved:.2g} rad, "
            f"the others by up to {most:.2g}: are order and signs of the joints right?",
        )


def wait_for_ground(
    link: Link,
    stand: Array,
    gains: Gains,
    estimate_force: Callable[[RobotSignals], float],
    weight: float,
    longest: float,
) -> None:
    """Hold the pose ``stand`` until the feet carry half the ``weight``, N, for a second.

    ``estimate_force`` returns the total force on the feet, N. Raises Unsafe after ``longest``, s.
    """
    link.move(stand, SETTLES, gains)
    end = time.monotonic() + longest
    carried = 0
    while carried < round(1.0 / link.period):
        Unsafe.unless(time.monotonic() <= end, f"not on the ground after plant.let_down={longest:g} s")
        link.move(stand, link.period, gains)
        carried = carried + 1 if estimate_force(link.signals) > CARRIED * weight else 0


def draw_chirp(link: Link, stand: Array) -> None:
    """Move all joints to and fro from the pose ``stand`` (4, 3), rad, faster in each stroke; raise Unsafe."""
    link.move(stand, MOVE, SLACK)
    phase = 0.0
    rate = (FASTEST / SLOWEST) ** (1.0 / (STROKES - 1))
    while phase < STROKES:
        swing = SWING * 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))
        link.send(stand + swing, 0.0, 0.0, *SLACK)
        link.receive()
        phase += link.period / (SLOWEST * rate ** np.floor(phase))
    link.move(stand, MOVE, SLACK)


def make_memory() -> Cmac:
    """Make a CMAC from the phase of a stroke to the torques of the joints of a leg, and compile its programs."""
    memory = Cmac([0.0], [1.0], outputs=len(SWING), layers=16)
    memory.update([0.0], memory.predict([0.0]), 0.0)
    return memory


def learn_strokes(link: Link, stand: Array, leg: int, memory: Cmac, lead: int, rate: float) -> Array:
    """Move a leg to and fro from the pose ``stand`` (4, 3), rad, while its ``memory`` learns the torque of drives.

    From the second stroke on the learnt torque is fed forward, limited to MOST_LEARNT. The torque of the drives
    trains the cells of ``lead`` samples before, with the learning rate ``rate``. Raises Unsafe.

    Returns the RMS of the joint error, rad, and of the feedback torque, N m, in each stroke, (LEARNT_STROKES, 2).
    """
    link.move(stand, MOVE, SLACK)
    samples = round(LEARNT_STROKE / link.period)
    squares = np.zeros((LEARNT_STROKES, 2))
    for stroke, sample in np.ndindex(LEARNT_STROKES, samples):
        turn = 2.0 * np.pi * sample / samples
        goal = stand.copy()
        velocity, learnt = np.zeros((2, *stand.shape))
        goal[leg] += SWING * 0.5 * (1.0 - np.cos(turn))
        velocity[leg] = SWING * np.pi / LEARNT_STROKE * np.sin(turn)
        if stroke > 0:
            learnt[leg] = np.clip(memory.predict([sample / samples]), -MOST_LEARNT, MOST_LEARNT)
        link.send(goal, velocity, learnt, *SLACK)
        link.receive()
        error = goal[leg] - link.signals.q[leg]
        torque = SLACK[0] * error + SLACK[1] * (velocity[leg] - link.signals.dq[leg])
        memory.update([(sample - lead) % samples / samples], torque, rate)
        squares[stroke] += (error**2).mean(), (torque**2).mean()
    link.move(stand, MOVE, SLACK)
    return np.sqrt(squares / samples)
