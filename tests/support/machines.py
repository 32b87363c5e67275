"""Simulated machines of four kinds, whose parameters are known, with logs that measure position and torque.

``axis`` is one prismatic axis, ``arm`` two links in the vertical plane, ``leg`` the same with friction
that depends on the angle, ``belt`` a motor that moves its load through a dead zone. The model lacks all parameters of
joints; the axis has 80 kg in it, and the rest of its mass is to be found.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from cmacexp.addons.gap.log import Log

PARTS = 10
"""Steps of the simulation per row, at least."""
STEP = 1e-4
"""Longest step of the simulation, s."""
GRAVITY = 9.81
AXIS = """<mujoco><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
<geom type="box" size=".1 .1 .1" mass="80"/></body></worldbody></mujoco>"""
LINKS = """<mujoco><compiler inertiafromgeom="false"/><worldbody><body><joint name="first" axis="0 1 0"/>
<inertial pos="0 0 {c1:.17g}" mass="{m1:.17g}" diaginertia="{i1:.17g} {i1:.17g} {small:.17g}"/>
<body pos="0 0 {l1:.17g}">
<joint name="second" axis="0 1 0"/><inertial pos="0 0 {c2:.17g}" mass="{m2:.17g}"
diaginertia="{i2:.17g} {i2:.17g} {small:.17g}"/></body></body></worldbody></mujoco>"""
BELT = """<mujoco><compiler inertiafromgeom="false"/><option gravity="0 0 0"/><worldbody><body>
<joint name="motor" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="{i:.17g} {i:.17g} {i:.17g}"/>
</body></worldbody></mujoco>"""


@dataclass(frozen=True)
class Simulated:
    """A log, the model that its designer has, and the truth."""

    log: Log
    model: str
    """MJCF."""
    truth: np.ndarray
    """(J, 3) rotor inertia, viscous friction and offset of the drive's torque."""
    friction: np.ndarray
    """(J, 3) polynomial of Coulomb friction over the angle, the highest power first."""

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write log and model, and return their paths."""
        import pandas as pd

        columns = {"time": self.log.time}
        for j, joint in enumerate(self.log.joints):
            columns |= {f"{key}_{joint}": getattr(self.log, name)[:, j] for key, name in SIGNALS.items()}
        pd.DataFrame(columns).to_parquet(folder / "log.parquet")
        (folder / "model.xml").write_text(self.model)
        return folder / "log.parquet", folder / "model.xml"


SIGNALS = {"q": "angle", "q_des": "command", "tau": "torque"}


@numba.njit
def simulate(command, period, parts, kp, kd, steps, mass, weight, joints, friction, belt):
    """Simulate two joints under a PD law of their measured angles; return angles and applied torques (n, 2).

    ``mass`` has m11, m12, m22 and c of M = [[m11 + 2 c cos q2, m12 + c cos q2], [., m22]], ``weight`` the two
    moments of gravity, ``joints`` (2, 3) rotor inertia, viscous friction and offset, ``friction`` (2, 3) polynomials,
    ``belt`` stiffness, damping and half of the dead zone between both joints.
    """
    n = len(command)
    angle = np.empty((n, 2))
    torque = np.empty((n, 2))
    q = command[0].copy()
    v = np.zeros(2)
    dry = np.zeros(2)
    before = q.copy()
    h = period / parts
    for k in range(n):
        seen = np.round(q / steps) * steps
        angle[k] = q
        torque[k] = kp * (command[k] - seen) - kd * (seen - before) / period
        before = seen
        for _ in range(parts):
            c = np.cos(q[1]) * mass[3]
            s = np.sin(q[1]) * mass[3]
            m11 = mass[0] + 2.0 * c + joints[0, 0]
            m12 = mass[1] + c
            m22 = mass[2] + joints[1, 0]
            twist = q[0] - q[1]
            beyond = twist - max(-belt[2], min(belt[2], twist))
            pull = belt[0] * beyond + belt[1] * (v[0] - v[1]) * (beyond != 0.0)
            f1 = torque[k, 0] + s * (2.0 * v[0] * v[1] + v[1] ** 2) - pull
            f2 = torque[k, 1] - s * v[0] ** 2 + pull
            f1 += weight[0] * np.sin(q[0]) + weight[1] * np.sin(q[0] + q[1]) - joints[0, 1] * v[0] - joints[0, 2]
            f2 += weight[1] * np.sin(q[0] + q[1]) - joints[1, 1] * v[1] - joints[1, 2]
            p1 = m11 * v[0] + m12 * v[1] + h * f1
            p2 = m12 * v[0] + m22 * v[1] + h * f2
            for i in range(2):
                dry[i] = h * (friction[i, 0] * q[i] ** 2 + friction[i, 1] * q[i] + friction[i, 2])
            for _ in range(12):
                rest = p1 - m12 * v[1]
                v[0] = np.sign(rest) * max(0.0, abs(rest) - dry[0]) / m11
                rest = p2 - m12 * v[0]
                v[1] = np.sign(rest) * max(0.0, abs(rest) - dry[1]) / m22
            q = q + h * v
    return angle, torque


def make_machines(kind: str, count: int, first: int = 0) -> Iterator[Simulated]:
    """Make ``count`` machines of a kind; their parameters, strokes and noise follow from seeds from ``first`` on."""
    for seed in range(first, first + count):
        yield KINDS[kind](np.random.default_rng([seed, *map(ord, kind)]))


def spread(random, *values, by=0.2):
    """Return values, each times a random factor from 1 - by to 1 + by."""
    return np.array(values) * random.uniform(1.0 - by, 1.0 + by, len(values))


def move(time, random, low, high, periods):
    """Return strokes (n,) between two positions, as raised cosines with rests, whose duration changes by stroke."""
    position = np.full(len(time), low)
    begin = 0.3
    for duration in periods:
        for a, b in ((low, high), (high, low)):
            half = 0.5 * duration
            share = np.clip((time - begin) / (0.85 * half), 0.0, 1.0)
            rows = time >= begin
            smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
            position[rows] = a + (b - a) * smooth[rows]
            begin += half
    return position


def measure(random, names, period, command, kp, kd, steps, noise, plant, model):
    """Simulate a machine and return its log, with encoder steps and ``noise`` of angles and torques."""
    parts = max(PARTS, int(np.ceil(period / STEP)))
    size = len(names)
    angle, torque = simulate(command, period, parts, kp, kd, np.broadcast_to(steps, 2).astype(float), *plant)
    angle = angle[:, :size] + noise[0] * random.normal(size=(len(angle), size))
    log = Log(
        path=Path("simulated"),
        time=np.arange(len(command)) * period,
        joints=names,
        angle=np.round(angle / steps) * steps,
        command=command[:, :size],
        command_velocity=np.zeros((len(command), size)),
        torque=torque[:, :size] * 1.0 + noise[1] * random.normal(size=(len(command), size)),
        feedforward=np.zeros((len(command), size)),
        kp=np.full(size, np.nan),
        kd=np.full(size, np.nan),
        orientation=None,
        names={"angle": "q_{joint}", "command": "q_des_{joint}", "torque": "tau_{joint}"},
    )
    _, _, joints, friction, _ = plant
    return Simulated(log, model, joints[:size], friction[:size])


def make_axis(random):
    """An axis of 95.1 kg with 203.5 N s/m, 20.39 N and -3.16 N, each within 20 %, and 24.8 s at 1 kHz."""
    period = 1e-3
    time = np.arange(0.0, 24.8, period)
    x = move(time, random, 0.0, 0.2, random.uniform(2.4, 4.4, 7))
    total, viscous, dry, offset = spread(random, 95.1, 203.5, 20.39, -3.16)
    joints = np.array([[total - 80.0, viscous, offset], [0.0, 0.0, 0.0]])
    friction = np.array([[0.0, 0.0, dry], [0.0, 0.0, 0.0]])
    plant = (np.array([80.0, 0.0, 1.0, 0.0]), np.zeros(2), joints, friction, np.zeros(3))
    kp, kd = np.array([4e4, 0.0]), np.array([4e3, 0.0])
    command = np.column_stack([x, np.zeros_like(x)])
    return measure(random, ("slide",), period, command, kp, kd, 1e-6, (1e-6, 2.0), plant, AXIS)


def make_links(random, m1, m2, l1, scale):
    """Return the equations of two links, and their model; ``scale`` is that of the length of the second."""
    c1, c2 = 0.45 * l1, 0.5 * scale
    i1, i2 = m1 * l1**2 / 12.0, m2 * scale**2 / 12.0
    mass = np.array([i1 + m1 * c1**2 + i2 + m2 * (l1**2 + c2**2), i2 + m2 * c2**2, i2 + m2 * c2**2, m2 * l1 * c2])
    weight = GRAVITY * np.array([m1 * c1 + m2 * l1, m2 * c2])
    values = {"c1": c1, "c2": c2, "i1": i1, "i2": i2, "m1": m1, "m2": m2, "l1": l1, "small": 0.1 * min(i1, i2)}
    return mass, weight, LINKS.format(**values)


def make_arm(random):
    """Two links of 0.4 m in the vertical plane, which move in sums of sines, for 20 s at 500 Hz."""
    period = 2e-3
    time = np.arange(0.0, 20.0, period)
    mass, weight, model = make_links(random, *spread(random, 4.0, 2.5, 0.4, 0.35))
    rates = random.uniform(0.2, 1.1, (2, 3))
    waves = np.sin(2.0 * np.pi * rates[:, :, None] * time) * np.array([[0.5], [0.25], [0.12]])
    command = (waves * np.minimum(1.0, time)).sum(axis=1).T + np.array([0.6, -0.8])
    joints = np.column_stack([spread(random, 0.25, 0.12), spread(random, 2.0, 1.2), random.uniform(-0.5, 0.5, 2)])
    friction = np.column_stack([np.zeros((2, 2)), spread(random, 3.0, 1.5)])
    plant = (mass, weight, joints, friction, np.zeros(3))
    kp, kd = np.array([900.0, 400.0]), np.array([40.0, 15.0])
    return measure(random, ("first", "second"), period, command, kp, kd, 2e-5, (1e-5, 0.15), plant, model)


def make_leg(random):
    """Thigh and calf on soft drives, as a Go2's, with friction over the angle, for 24 s at 200 Hz."""
    period = 5e-3
    time = np.arange(0.0, 24.0, period)
    mass, weight, model = make_links(random, *spread(random, 1.2, 0.35, 0.21, 0.2))
    turns = 2.0 * np.pi * np.cumsum(1.0 / np.linspace(2.6, 0.9, len(time))) * period
    command = np.column_stack([0.6 - 0.5 * np.cos(turns), -1.2 + 0.6 * np.cos(turns - random.uniform(0.6, 1.2))])
    joints = np.column_stack([spread(random, 0.01, 0.024), spread(random, 0.1, 0.15), random.uniform(-0.1, 0.1, 2)])
    height, slope = spread(random, 0.35, 0.6), random.uniform(-0.4, 0.4, 2)
    friction = np.column_stack([random.uniform(0.0, 0.1, 2), slope * height, height - [0.6, -1.2] * slope * height])
    plant = (mass, weight, joints, friction, np.zeros(3))
    kp, kd = np.array([25.0, 25.0]), np.array([1.0, 1.0])
    return measure(random, ("first", "second"), period, command, kp, kd, 3e-5, (3e-5, 0.05), plant, model)


def make_belt(random):
    """A motor and its load behind a dead zone, for 20 s at 500 Hz; motor angle and torque are measured."""
    period = 2e-3
    time = np.arange(0.0, 20.0, period)
    x = move(time, random, 0.0, 6.0, random.uniform(1.5, 3.0, 8))
    load = float(spread(random, 0.01)[0])
    rotor, viscous, dry = spread(random, 0.012, 0.05, 0.3)
    joints = np.array([[rotor, viscous, random.uniform(-0.05, 0.05)], [0.0, 0.0, 0.0]])
    friction = np.array([[0.0, 0.0, dry], [0.0, 0.0, 0.0]])
    plant = (np.array([0.0, 0.0, load, 0.0]), np.zeros(2), joints, friction, np.array([2e3, 0.5, 0.01]))
    kp, kd = np.array([20.0, 0.0]), np.array([0.8, 0.0])
    command = np.column_stack([x, x])
    return measure(random, ("motor",), period, command, kp, kd, 1e-4, (5e-5, 0.02), plant, BELT.format(i=load))


KINDS = {"axis": make_axis, "arm": make_arm, "leg": make_leg, "belt": make_belt}
"""Makers of machines by kind."""
