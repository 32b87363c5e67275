"""Random worlds and settings in which learning is guarded."""

from collections.abc import Sequence
from typing import Any

import numpy as np

ONE_LEG, QUADRUPED, GO1, ALIENGO = "one leg", "quadruped", "Go1", "Aliengo"
SCENARIOS = {
    ONE_LEG: ("scenario=one_leg", "learning=lasting"),
    QUADRUPED: ("scenario=quadruped_lasting", "gait.duty_factor=0.9"),
    GO1: ("scenario=robot", "machine=go1"),
    ALIENGO: ("scenario=robot", "machine=aliengo"),
}
STIFFNESS = {ONE_LEG: 10.0, QUADRUPED: 1e4}
"""That the plan assumes, N/m; robots' follows from their model."""


class Draw:
    """Random choices of one world, the same for the same machine and number."""

    def __init__(self, machine: str, number: int):
        self.machine = machine
        self.chance = np.random.default_rng([list(SCENARIOS).index(machine), number])

    def one_of(self, *choices: Any) -> Any:
        """One of the choices; those that are listed twice are twice as likely."""
        return choices[self.chance.integers(len(choices))]

    def between(self, low: float, high: float) -> str:
        """A number, as an override says it."""
        return f"{self.chance.uniform(low, high):.3g}"

    def log_between(self, low: float, high: float) -> str:
        """The same, with an even logarithm."""
        return f"{np.exp(self.chance.uniform(np.log(low), np.log(high))):.3g}"

    def happens(self, chance: float) -> bool:
        """Whether something does."""
        return bool(self.chance.random() < chance)


def draw_sensors(draw: Draw) -> list[str]:
    """Sensors that are perfect, encoders, or late and noisy."""
    kind = draw.one_of("perfect", "encoders", "real", "real")
    if kind != "real" or draw.machine in (GO1, ALIENGO):
        return [f"sensors={'encoders' if kind == 'real' else kind}"]
    return [
        "sensors=real",
        f"sensors.velocity.delay={draw.one_of(0, 1, 2)}",
        f"sensors.velocity.noise={draw.one_of(0.0, 0.02)}",
        f"sensors.position.delay={draw.one_of(0, 0, 1)}",
        f"sensors.force.noise_relative={draw.one_of(0.0, 0.05, 0.2)}",
    ]


def draw_ground(draw: Draw) -> list[str]:
    """Ground that the plan does not know: stiffness, patches, slope."""
    known, ground = STIFFNESS.get(draw.machine), []
    if known is not None:
        stiffness = known * float(draw.log_between(0.5, 2.0))
        ground += [f"terrain.stiffness={stiffness:.4g}", f"terrain.assumed_stiffness={known:g}"]
    if draw.happens(0.4):
        ground += ["terrain.patch_spread=0.3", "terrain.patch_size=0.15"]
        ground += [f"terrain.patch_seed={draw.chance.integers(100)}"]
    if draw.happens(0.4):
        ground += [f"terrain.slope={draw.between(-0.05, 0.05)}"]
    return ground


def draw_payload(draw: Draw) -> list[str]:
    """A load that the plan does not know; one leg has no body that carries it."""
    if draw.machine == ONE_LEG or draw.happens(0.5):
        return []
    x, y = (0.1, 0.07) if draw.machine == QUADRUPED else (0.05, 0.03)
    return [
        f"payload.weight={draw.between(5.0, 20.0)}",
        f"payload.x={draw.between(-x, x)}",
        f"payload.y={draw.between(-y, y)}",
    ]


def draw_world(machine: str, number: int) -> tuple[str, ...]:
    """Overrides of a world, and of a rate and a lead that may be wrong in it."""
    draw = Draw(machine, number)
    return (
        *draw_sensors(draw),
        f"actuator.delay={draw.one_of(0, 0, 1)}",
        *draw_ground(draw),
        *draw_payload(draw),
        f"learning.rate={draw.log_between(0.03, 1.2)}",
        f"learning.lead={draw.one_of('auto', 0, 1, 2, 3)}",
        f"seed={number}",
    )


LAYERS, RESOLUTIONS, PERIODS = (8, 16, 32, 64), (9, 17, 33, 65), (0.004, 0.005, 0.008)
RULES = ("paper", "paper", "paper", "normalised", "leakage", "weight_smoothing", "decaying_rate")


def draw_settings(number: int) -> Sequence[str]:
    """Overrides of one leg that learns for long: gains, rate, lead, network, period, ground and step."""
    draw = Draw(ONE_LEG, 10**6 + number)
    gain, period = float(draw.log_between(50.0, 250.0)), draw.one_of(*PERIODS)
    stiffness = float(draw.log_between(8.0, 100.0))
    elasticity = float(draw.log_between(0.1, 3.0)) / stiffness
    samples = 20 * round(float(draw.between(2.0, 4.0)) / period / 20)
    return (
        f"controller.position_gain={gain:.4g}",
        f"controller.velocity_gain={0.5 * gain**0.5 * float(draw.log_between(0.6, 1.6)):.4g}",
        f"learning.rate={draw.log_between(0.03, 1.2)}",
        f"learning.lead={draw.one_of('auto', 0, 1, 2, 3)}",
        f"learning.rule={draw.one_of(*RULES)}",
        f"actuator.delay={draw.one_of(0, 0, 1)}",
        f"cmac.layers={draw.one_of(*LAYERS)}",
        f"cmac.resolution_elements={draw.one_of(*RESOLUTIONS)}",
        *("cmac.addressing=visited", "cmac.memory_bytes=4000000"),
        *(f"sampling_period={period}", f"gait.cycle_time={samples * period:.6g}"),
        f"gait.stroke={draw.between(0.08, 0.2)}",
        f"terrain.stiffness={stiffness:.4g}",
        f"force_control.elasticity={elasticity:.4g}",
        f"force_control.admittance={elasticity * float(draw.log_between(0.3, 2.0)):.4g}",
    )
