"""What a robot does while it hangs: its joints are checked, it is let down, draws a chirp, or learns with one leg."""

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
"""Gains of a robot that hangs."""
SLACK: Gains = (20.0, 1.5)
"""Gains of a robot that draws a chirp: its friction shows in what it lacks."""
WIGGLE, ANSWERED, CROSSTALK = 0.1, 0.04, 0.04
"""Angle by which a hanging joint is moved, how much of it must be seen, and how much of it in another joint, rad."""
CALF = 2
OFF = 0.8
"""Largest difference of a holding torque from that of the model, N m."""
MOVE, HOLD = 2.0, 0.25
"""Time of a slow motion while it hangs, and of each small one, s."""
CARRIED = 0.5
"""Part of its weight from which on a robot stands."""
SWING = np.array([0.6, 0.7, -0.9])
"""Swing of a chirp, from the pose in which a robot stands, of hip, thigh and calf, rad."""
SLOWEST, FASTEST, STROKES = 2.9, 0.7, 12
"""Periods of the first and the last stroke of a chirp, s, and their number."""
LEARNT_STROKE, LEARNT_STROKES = 1.5, 20
"""Time of a stroke of a leg that learns, s, and their number."""
MOST_LEARNT = 5.0
"""Largest torque of what a leg that hangs has learnt, N m."""


def find_holding_torque(robot: Robot, stand: Array) -> Array:
    """Torques (4, 3) that hold the legs of a level robot that hangs in the pose ``stand`` (4, 3), rad, N m."""
    data = robot.at(stand)
    load_mujoco().mj_forward(robot.model, data)
    return np.array(data.qfrc_bias[robot.legs.dof])


def check_joints(link: Link, stand: Array, expected: Array) -> None:
    """Move each joint a little up and down, and compare what it holds with the model; raises Unsafe.

    Friction has opposite signs after a motion up and one down, and cancels in their mean; but not at the calf, where
    it differs too much: a calf that turns the other way is where none can be. ``stand`` (4, 3), rad, is the pose,
    ``expected`` (4, 3), N m, what holds it.
    """
    link.move(stand, MOVE, SOFT)
    for leg, joint in np.ndindex(stand.shape):
        held = 0.0
        for angle in (WIGGLE, -WIGGLE):
            before, goal = link.signals.q, stand.copy()
            goal[leg, joint] += angle
            link.move(goal, HOLD, SOFT)
            moved = (link.signals.q - before) * np.sign(angle)
            link.move(stand, HOLD, SOFT)
            link.move(stand, HOLD, SOFT)  # until it rests
            held += 0.5 * float(link.signals.torque[leg, joint])
            others = np.delete(np.abs(moved), leg * stand.shape[1] + joint)
            Unsafe.unless(
                moved[leg, joint] >= ANSWERED and others.max() <= CROSSTALK,
                f"{name_joint(leg, joint)}, asked for {WIGGLE:g} rad, moved by {moved[leg, joint]:.2g} rad, "
                f"the others by up to {others.max():.2g}",
            )
        Unsafe.unless(
            joint == CALF or abs(held - expected[leg, joint]) <= OFF,
            f"{name_joint(leg, joint)} holds {held:.2g} N m, by the model {expected[leg, joint]:.2g}: "
            "does the robot hang, and are order and signs of the joints right?",
        )


def wait_for_ground(
    link: Link,
    stand: Array,
    gains: Gains,
    estimate_force: Callable[[RobotSignals], float],
    weight: float,
    longest: float,
) -> None:
    """Hold still until the legs carry half the ``weight``, N, for a second; raises Unsafe after ``longest``, s.

    ``estimate_force`` gives the force on all feet, N.
    """
    end, needed, carried = time.monotonic() + longest, round(1.0 / link.period), 0
    while carried < needed:
        Unsafe.unless(time.monotonic() <= end, f"not on the ground after plant.let_down={longest:g} s")
        link.move(stand, link.period, gains)
        carried = carried + 1 if estimate_force(link.signals) > CARRIED * weight else 0


def draw_chirp(link: Link, stand: Array) -> None:
    """Move all joints to and fro about ``stand`` (4, 3), rad, ever faster; raises Unsafe."""
    link.move(stand, MOVE, SLACK)
    phase, rate = 0.0, (FASTEST / SLOWEST) ** (1.0 / (STROKES - 1))
    while phase < STROKES:
        swing = SWING * 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))
        link.send(stand + swing, 0.0, 0.0, *SLACK)
        link.receive()
        phase += link.period / (SLOWEST * rate ** np.floor(phase))
    link.move(stand, MOVE, SLACK)


def make_memory() -> Cmac:
    """A CMAC over the phase of a stroke, with a torque for each joint of a leg, whose programs are compiled."""
    memory = Cmac([0.0], [1.0], outputs=len(SWING), layers=16)
    memory.update([0.0], memory.predict([0.0]), 0.0)
    return memory


def learn_strokes(link: Link, stand: Array, leg: int, memory: Cmac, lead: int, rate: float) -> Array:
    """Move a leg to and fro while its ``memory`` learns the torque of its drives; raises Unsafe.

    From the second stroke on what it has learnt acts, up to MOST_LEARNT. ``stand`` (4, 3), rad, is where it begins,
    ``lead``, samples, and ``rate`` are those of learning.

    Returns (LEARNT_STROKES, 2), of each stroke: RMS of the joints' error, rad, and of their drives' torque, N m.
    """
    link.move(stand, MOVE, SLACK)
    samples, squares = round(LEARNT_STROKE / link.period), np.zeros((LEARNT_STROKES, 2))
    for stroke, sample in np.ndindex(LEARNT_STROKES, samples):
        turn = 2.0 * np.pi * sample / samples
        goal, velocity, learnt = stand.copy(), np.zeros_like(stand), np.zeros_like(stand)
        goal[leg] += SWING * 0.5 * (1.0 - np.cos(turn))
        velocity[leg] = SWING * np.pi / LEARNT_STROKE * np.sin(turn)
        if stroke > 0:
            learnt[leg] = np.clip(memory.predict([sample / samples]), -MOST_LEARNT, MOST_LEARNT)
        link.send(goal, velocity, learnt, *SLACK)
        link.receive()
        error, slip = goal[leg] - link.signals.q[leg], velocity[leg] - link.signals.dq[leg]
        torque = SLACK[0] * error + SLACK[1] * slip
        memory.update([(sample - lead) % samples / samples], torque, rate)
        squares[stroke] += (error**2).mean(), (torque**2).mean()
    link.move(stand, MOVE, SLACK)
    return np.sqrt(squares / samples)
