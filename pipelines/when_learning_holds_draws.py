"""Random settings of one leg, of the quadruped and of robots, whether or not learning holds with them."""

from typing import Any

import numpy as np

LEG, WALK, ROBOT = "one leg", "quadruped", "robots"
SCENARIOS = {LEG: "one_leg", WALK: "quadruped", ROBOT: "robot"}
ROBOTS = ("go1", "go2", "aliengo", "mini_cheetah")
GAINS = {LEG: (100.0, 5.0), WALK: (50.0, 5.0)}
"""Position gain, N/m, and velocity gain, N s/m, that are scaled."""
STIFFNESS = {LEG: (8.0, 100.0), WALK: (4e3, 3e4)}
"""Least and largest stiffness of the ground, N/m."""
RULES = (*["paper"] * 13, "normalised", "leakage", "weight_smoothing", "zero_phase")
BOUNDED = ("dead_zone", "e_modification", "decaying_rate")
FIRST = 10
"""Cycle in which learning begins: nothing is said of settings with which feedback alone does not last so long."""


class Draws:
    """Settings by their numbers: the same number gives the same settings.

    Args:
        machine: one of SCENARIOS.
        seed: other seeds give other settings.
    """

    def __init__(self, machine: str, seed: int):
        self.machine, self.seed = machine, seed

    def draw(self, number: int) -> tuple[str, ...]:
        """The overrides of one config."""
        self._random = np.random.default_rng((self.seed, number))
        if self.machine == ROBOT:  # its gains, gait and memory follow from its model
            parts = [f"machine={self._choose(*ROBOTS)}"]
        else:
            parts = [*self._control(), *self._memory(), *self._gait()]
        parts += [*self._lateness(), *self._learning()]
        return (f"scenario={SCENARIOS[self.machine]}", "warn=false", *parts)

    def _between(self, low: float, high: float) -> float:
        """Even in the logarithm."""
        return float(np.exp(self._random.uniform(np.log(low), np.log(high))))

    def _choose(self, *values: Any) -> Any:
        return values[self._random.integers(len(values))]

    def _control(self) -> list[str]:
        position, velocity = GAINS[self.machine]
        factor = self._between(0.4, 4.0)
        velocity *= float(np.sqrt(factor)) * self._between(0.5, 2.5)
        lead = "lead_alpha=1.0" if self._random.random() < 0.12 else f"lead_omega={self._between(5.0, 30.0):.3g}"
        return [
            f"controller.position_gain={position * factor:.4g}", f"controller.velocity_gain={velocity:.4g}",
            f"controller.{lead}",
        ]  # fmt: skip

    def _lateness(self) -> list[str]:
        return [
            "sensors=real", f"sensors.velocity.delay={self._choose(0, 0, 0, 1, 2)}",
            f"actuator.delay={self._choose(0, 0, 0, 0, 1, 2)}", f"actuator.lag={self._choose(0, 0, 0, 0.005, 0.01)}",
        ]  # fmt: skip

    def _learning(self) -> list[str]:
        return [
            f"learning.rate={self._between(0.02, 0.6):.3g}",
            f"learning.lead={self._choose('auto', 'auto', *range(5))}",
            f"learning.rule={self._choose(*RULES, *BOUNDED)}", "learning.guard=none",
            f"learning.start_cycle={FIRST}",
        ]  # fmt: skip

    def _memory(self) -> list[str]:
        fields = ("rectangular", "rectangular", "rectangular", "linear", "cubic")
        return [
            f"cmac.layers={self._choose(8, 16, 32, 64, 128)}",
            f"cmac.resolution_elements={self._choose(5, 9, 17, 33, 65)}",
            f"cmac.displacement={self._choose('diagonal', 'diagonal', 'odd_lattice')}",
            f"cmac.addressing={self._choose('hashed', 'visited')}", "cmac.memory_bytes=4000000",
            f"cmac.receptive_field={self._choose(*fields)}",
            f"cmac.inputs={self._choose('[angle]', '[angle,velocity]', '[angle,velocity,acceleration]')}",
        ]  # fmt: skip

    def _gait(self) -> list[str]:
        period = self._choose(0.002, 0.004, 0.005, 0.005, 0.008, 0.01)
        samples = 20 * int(self._random.uniform(1.5, 4.0) / period / 20)
        stiffness = self._between(*STIFFNESS[self.machine])
        elasticity = self._between(0.1, 5.0) / stiffness
        return [
            f"sampling_period={period}", f"gait.cycle_time={samples * period:.6g}",
            f"gait.stroke={self._random.uniform(0.05, 0.25):.3g}",
            f"gait.vertical={self._choose('cubic', 'two_cubics')}", f"terrain.stiffness={stiffness:.4g}",
            f"force_control.elasticity={elasticity:.4g}",
            f"force_control.admittance={elasticity * self._between(0.3, 2.0):.4g}",
        ]  # fmt: skip
