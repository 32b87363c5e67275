"""Simulated logs of a machine with known parameters, for users without a log: two uncoupled pendulums.

The simulation uses semi-implicit Euler with dry friction in closed form and ``parts`` steps per sampling period. The
replay of ``cmacexp gap`` has second order and uses only the equations along the log.
"""

from pathlib import Path

import numpy as np

from cmacexp.addons.gap.log import Log

MODEL = Path(__file__).with_name("pendulums.xml")
"""Model of the machine with generic joints, as its designer knows it."""
PERIOD = 0.01
NAMES = ("hip", "knee")
LENGTH, MASS = np.array([0.2, 0.25]), np.array([1.5, 0.8])
INERTIA, WEIGHT = MASS * LENGTH**2, 9.81 * MASS * LENGTH


ROTORS, VISCOUS, COULOMB = (0.02, 0.03), (0.1, 0.2), (0.3, 0.2)
"""Rotor inertia, kg m^2, viscous friction, N m s/rad, and Coulomb friction, N m, of the joints."""
DELAY = 0.004
"""Delay of the commands, s."""


def simulate_log(
    delay: float = DELAY, seconds: float = 12.0, noise: float = 2e-4, seed: int = 0, parts: int = 10
) -> Log:
    """Simulate a log of strokes whose period falls from 2 to 0.8 s; the knee lags the hip.

    Args:
        delay: delay of the commands, s.
        seconds: duration, s.
        noise: standard deviation of the encoder noise, rad.
        seed: seed of the noise.
        parts: simulation steps per sampling period.
    """
    time = np.arange(0.0, seconds, PERIOD)
    turns = np.cumsum(1.0 / np.linspace(2.0, 0.8, len(time))) * PERIOD * 2.0 * np.pi
    command = np.stack([0.3 - 0.5 * np.cos(turns), -0.6 + 0.4 * np.cos(turns - 0.9)], axis=1)
    kp, kd = np.array([20.0, 15.0]), np.array([0.8, 0.6])
    total = INERTIA + ROTORS
    angle, velocity = command[0].copy(), np.zeros(2)
    h = PERIOD / parts
    measured = np.empty_like(command)
    for row in range(len(time)):
        measured[row] = angle
        for step in range(parts):
            acting = command[max(0, int(np.floor(row + (step * h - delay) / PERIOD + 1e-9)))]
            torque = kp * (acting - angle) - kd * velocity - WEIGHT * np.sin(angle)
            wanted = velocity + h * (torque - np.multiply(VISCOUS, velocity)) / total
            dry = h * np.array(COULOMB) / total
            velocity = np.sign(wanted) * np.maximum(np.abs(wanted) - dry, 0.0)
            angle = angle + h * velocity
    return Log(
        path=Path("simulated"),
        time=time,
        joints=NAMES,
        angle=measured + np.random.default_rng(seed).normal(size=measured.shape) * noise,
        command=command,
        command_velocity=np.zeros_like(command),
        torque=None,
        feedforward=np.zeros_like(command),
        kp=kp,
        kd=kd,
        orientation=None,
        names={"angle": "q_{joint}", "command": "q_des_{joint}"},
    )
