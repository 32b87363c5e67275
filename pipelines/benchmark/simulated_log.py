"""Logs of a machine whose truth is known, for those who have no log: pendulums that move apart from each other.

The simulation is semi-implicit Euler with dry friction in closed form, in ``parts`` of a sampling period; the replay
of ``cmacexp gap`` is of second order and knows only the equations along the log.
"""

from pathlib import Path

import numpy as np

from cmacexp.addons.gap.log import Log

MODEL = Path(__file__).with_name("pendulums.xml")
"""The machine as a designer knows it: joints are generic."""
PERIOD = 0.01
NAMES = ("hip", "knee")
LENGTH, MASS = np.array([0.2, 0.25]), np.array([1.5, 0.8])
INERTIA, WEIGHT = MASS * LENGTH**2, 9.81 * MASS * LENGTH


ROTORS, VISCOUS, COULOMB, DELAY = (0.02, 0.03), (0.1, 0.2), (0.3, 0.2), 0.004
"""Of the joints: rotor inertia, viscous friction, Coulomb friction; and the delay of the commands, s."""


def simulate_log(
    delay: float = DELAY, seconds: float = 12.0, noise: float = 2e-4, seed: int = 0, parts: int = 10
) -> Log:
    """A log of strokes whose period falls from 2 to 0.8 s, the knee behind the hip, with noise of encoders, rad."""
    time = np.arange(0.0, seconds, PERIOD)
    turns = np.cumsum(1.0 / np.linspace(2.0, 0.8, len(time))) * PERIOD * 2.0 * np.pi
    command = np.stack([0.3 - 0.5 * np.cos(turns), -0.6 + 0.4 * np.cos(turns - 0.9)], axis=1)
    kp, kd = np.array([20.0, 15.0]), np.array([0.8, 0.6])
    total = INERTIA + ROTORS
    angle, velocity, h = command[0].copy(), np.zeros(2), PERIOD / parts
    found = np.empty_like(command)
    for row in range(len(time)):
        found[row] = angle
        for part in range(parts):
            acting = command[max(0, int(np.floor(row + (part * h - delay) / PERIOD + 1e-9)))]
            torque = kp * (acting - angle) - kd * velocity - WEIGHT * np.sin(angle)
            wanted = velocity + h * (torque - np.multiply(VISCOUS, velocity)) / total
            dry = h * np.array(COULOMB) / total
            velocity = np.sign(wanted) * np.maximum(np.abs(wanted) - dry, 0.0)
            angle = angle + h * velocity
    return Log(
        path=Path("simulated"),
        time=time,
        joints=NAMES,
        angle=found + np.random.default_rng(seed).normal(size=found.shape) * noise,
        command=command,
        command_velocity=np.zeros_like(command),
        torque=None,
        feedforward=np.zeros_like(command),
        kp=kp,
        kd=kd,
        orientation=None,
        names={"angle": "q_{joint}", "command": "q_des_{joint}"},
    )
