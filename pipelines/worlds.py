"""Generator of all random runs: worlds unknown to planner and controller, and random hyperparameters of learning.

Every choice is drawn by :class:`Draw` from a seed, a machine and a number, so that a number always gives the same
world, whichever method learns in it. Three distributions are declared below:

=============== ======================================================================================= ==========
function        what varies, and how                                                                    drawn for
=============== ======================================================================================= ==========
draw_world      ground and masses (even within e^±0.3, ±20 %), start, encoders with noise and delay     most studies
draw_hard_world sensors, ground within factor 2, slope, payload, a rate and a lead that may be wrong    guard
draw_settings   gains, LEAD, memory, gait, ground, delays and learning law                              when learning
                                                                                                        stays bounded
=============== ======================================================================================= ==========
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

WALK = (1e4, 0.15, 0.01)
WORLDS: dict[str, tuple[float | None, float, float]] = {
    "one_leg": (10.0, 0.1, 0.05), "quadruped": WALK, "quadruped_lasting": WALK, "robot": (None, 0.1, 0.02),
}  # fmt: skip
"""By scenario: ground stiffness that the planner assumes, N/m; side of a patch of ground, m; start error, rad.

The start error is the largest difference of the joint angles at the start from the planned ones. For robots the
stiffness follows from their model.
"""
FIRST_TUNING = 1_000_000
"""Number of the first world for tuning; worlds for tuning and for testing are disjoint."""
TESTED = range(24)
"""Numbers of the worlds in which studies test."""
FEWER = TESTED[:12]
"""Numbers of the worlds in which studies test long runs."""


class Draw(np.random.Generator):
    """Random generator for the choices of one run.

    Args:
        seed: seed; equal seeds give equal choices.
    """

    def __init__(self, *seed: int):
        super().__init__(np.random.PCG64(seed))

    def choose(self, *values: Any) -> Any:
        """Return one of the values at random; a value that is listed twice is twice as likely."""
        return values[self.integers(len(values))]

    def even_log(self, low: float, high: float) -> float:
        """Return a log-uniform random number between ``low`` and ``high``."""
        return float(np.exp(self.uniform(np.log(low), np.log(high))))


def draw_world(scenario: str, number: int, stiffer: float = 1.0) -> tuple[str, ...]:
    """Draw the overrides of a world.

    Args:
        scenario: ``one_leg``, ``quadruped``, ``quadruped_lasting`` or ``robot``.
        number: number of the world, and seed of the hash of a network.
        stiffer: factor of the true ground stiffness, unknown to the planner; without effect for ``robot``.
    """
    draw = Draw(2026, sorted(WORLDS).index(scenario), number)
    assumed, patch, start = WORLDS[scenario]
    true = assumed and stiffer * assumed * float(np.exp(draw.uniform(-0.3, 0.3)))
    # A robot's gains by rule allow for the delay of its sensors; without one, a later torque delay destabilises it.
    return (
        f"seed={number}",
        *((f"terrain.stiffness={true:.5g}", f"terrain.assumed_stiffness={assumed:g}") if assumed else ()),
        *("terrain.patch_spread=0.2", f"terrain.patch_size={patch}", f"terrain.patch_seed={number}"),
        f"plant.mass_factor={draw.uniform(0.8, 1.2):.4f}",
        *(f"plant.start_spread={start}", f"plant.start_seed={number}"),
        "sensors=encoders",
        f"sensors.velocity.delay={max(draw.choose(0, 1), scenario == 'robot'):d}",
        f"sensors.velocity.noise={draw.even_log(0.005, 0.05):.4f}",
        f"sensors.force.noise_relative={draw.uniform(0.0, 0.1):.4f}",
    )


def draw_worlds(scenario: str, numbers: Iterable[int], stiffer: float = 1.0) -> dict[int, list[str]]:
    """Draw the overrides of several worlds, by number, as values of the setting ``world``; see :func:`draw_world`."""
    return {number: [*draw_world(scenario, number, stiffer)] for number in numbers}


ONE_LEG, QUADRUPED, GO1, ALIENGO = "one leg", "quadruped", "Go1", "Aliengo"
HARD = {
    ONE_LEG: ("scenario=one_leg", "learning=lasting"),
    QUADRUPED: ("scenario=quadruped_lasting", "gait.duty_factor=0.9"),
    GO1: ("scenario=robot", "machine=go1"),
    ALIENGO: ("scenario=robot", "machine=aliengo"),
}
"""Overrides of the machines in hard worlds."""


def _draw_sensors(draw: Draw, robot: bool) -> list[str]:
    """Draw overrides of the sensors: perfect, encoders, or delayed and noisy."""
    kind = draw.choose("perfect", "encoders", "real", "real")
    if kind != "real" or robot:
        return [f"sensors={'encoders' if kind == 'real' else kind}"]
    return [
        "sensors=real",
        f"sensors.velocity.delay={draw.choose(0, 1, 2)}",
        f"sensors.velocity.noise={draw.choose(0.0, 0.02)}",
        f"sensors.position.delay={draw.choose(0, 0, 1)}",
        f"sensors.force.noise_relative={draw.choose(0.0, 0.05, 0.2)}",
    ]


def _draw_ground(draw: Draw, assumed: float | None) -> list[str]:
    """Draw overrides of ground that is unknown to the planner, which assumes this stiffness, N/m: patches, slope."""
    true = assumed and assumed * float(f"{draw.even_log(0.5, 2.0):.3g}")
    return [
        *((f"terrain.stiffness={true:.4g}", f"terrain.assumed_stiffness={assumed:g}") if assumed else ()),
        *(
            ("terrain.patch_spread=0.3", "terrain.patch_size=0.15", f"terrain.patch_seed={draw.integers(100)}")
            if draw.random() < 0.4
            else ()
        ),
        *((f"terrain.slope={draw.uniform(-0.05, 0.05):.3g}",) if draw.random() < 0.4 else ()),
    ]


def _draw_payload(draw: Draw, machine: str) -> list[str]:
    """Draw overrides of a payload that is unknown to the planner; none for one leg, which has no body."""
    if machine == ONE_LEG or draw.random() < 0.5:
        return []
    ends = {"weight": (5.0, 20.0), "x": (-0.05, 0.05), "y": (-0.03, 0.03)}
    ends |= {"x": (-0.1, 0.1), "y": (-0.07, 0.07)} if machine == QUADRUPED else {}
    return [f"payload.{key}={draw.uniform(low, high):.3g}" for key, (low, high) in ends.items()]


def draw_hard_world(machine: str, number: int) -> tuple[str, ...]:
    """Draw the overrides of a world of ``HARD``, with a rate and a lead that may be wrong for it."""
    draw = Draw(list(HARD).index(machine), number)
    return (
        *_draw_sensors(draw, machine in (GO1, ALIENGO)),
        f"actuator.delay={draw.choose(0, 0, 1)}",
        *_draw_ground(draw, WORLDS.get(machine.replace(" ", "_"), (None,))[0]),
        *_draw_payload(draw, machine),
        f"learning.rate={draw.even_log(0.03, 1.2):.3g}",
        f"learning.lead={draw.choose('auto', 0, 1, 2, 3)}",
        f"seed={number}",
    )


def draw_long(number: int) -> Sequence[str]:
    """Draw the overrides of a long run of one leg: gains, rate, lead, network, period, ground and stroke."""
    draw = Draw(list(HARD).index(ONE_LEG), 10**6 + number)
    gain = float(f"{draw.even_log(50.0, 250.0):.3g}")
    period = draw.choose(0.004, 0.005, 0.008)
    stiffness = float(f"{draw.even_log(8.0, 100.0):.3g}")
    elasticity = float(f"{draw.even_log(0.1, 3.0):.3g}") / stiffness
    samples = 20 * round(float(f"{draw.uniform(2.0, 4.0):.3g}") / period / 20)
    return (
        f"controller.position_gain={gain:.4g}",
        f"controller.velocity_gain={0.5 * gain**0.5 * float(f'{draw.even_log(0.6, 1.6):.3g}'):.4g}",
        f"learning.rate={draw.even_log(0.03, 1.2):.3g}",
        f"learning.lead={draw.choose('auto', 0, 1, 2, 3)}",
        f"learning.rule={draw.choose(*3 * ['paper'], 'normalised', 'leakage', 'weight_smoothing', 'decaying_rate')}",
        f"actuator.delay={draw.choose(0, 0, 1)}",
        f"cmac.layers={draw.choose(8, 16, 32, 64)}",
        f"cmac.resolution_elements={draw.choose(9, 17, 33, 65)}",
        *("cmac.addressing=visited", "cmac.memory_bytes=4000000"),
        *(f"sampling_period={period}", f"gait.cycle_time={samples * period:.6g}"),
        f"gait.stroke={draw.uniform(0.08, 0.2):.3g}",
        f"terrain.stiffness={stiffness:.4g}",
        f"force_control.elasticity={elasticity:.4g}",
        f"force_control.admittance={elasticity * float(f'{draw.even_log(0.3, 2.0):.3g}'):.4g}",
    )


ROBOT = "robots"
MACHINES: dict[str, tuple[str, tuple[float, ...], tuple[float, ...]]] = {
    ONE_LEG: ("one_leg", (100.0, 5.0), (8.0, 100.0)),
    QUADRUPED: ("quadruped", (50.0, 5.0), (4e3, 3e4)),
    ROBOT: ("robot", (), ()),
}
"""By machine: scenario; position gain, N/m, and velocity gain, N s/m, to be scaled; range of ground stiffness, N/m.

For robots gains and stiffness follow from their model.
"""
RULES = (
    *(["paper"] * 13), "normalised", "leakage", "weight_smoothing", "zero_phase", "dead_zone", "e_modification",
    "decaying_rate",
)  # fmt: skip
FIRST = 10
"""First cycle of learning; configurations with which feedback only ends before are left out."""


def draw_settings(machine: str, seed: int, number: int) -> tuple[str, ...]:
    """Draw the overrides of a random configuration; for robots gains, gait and memory follow from their model.

    Args:
        machine: one of MACHINES.
        seed: seed of a set of configurations.
        number: number of the configuration in its set.
    """
    draw = Draw(seed, number)
    return (
        f"scenario={MACHINES[machine][0]}", "warn=false",
        *(_draw_machine(draw, machine) if machine != ROBOT else
          [f"machine={draw.choose('go1', 'go2', 'aliengo', 'mini_cheetah')}"]), "sensors=real",
        f"sensors.velocity.delay={draw.choose(0, 0, 0, 1, 2)}", f"actuator.delay={draw.choose(0, 0, 0, 0, 1, 2)}",
        f"actuator.lag={draw.choose(0, 0, 0, 0.005, 0.01)}", f"learning.rate={draw.even_log(0.02, 0.6):.3g}",
        f"learning.lead={draw.choose('auto', 'auto', *range(5))}", f"learning.rule={draw.choose(*RULES)}",
        "learning.guard=none", f"learning.start_cycle={FIRST}",
    )  # fmt: skip


def _draw_machine(draw: Draw, machine: str) -> list[str]:
    """Draw overrides of controller, memory, gait and ground of one leg or the quadruped."""
    _, (position, velocity), soft_to_hard = MACHINES[machine]
    factor = draw.even_log(0.4, 4.0)
    velocity *= float(np.sqrt(factor)) * draw.even_log(0.5, 2.5)
    lead = "lead_alpha=1.0" if draw.random() < 0.12 else f"lead_omega={draw.even_log(5.0, 30.0):.3g}"
    parts = [
        f"controller.position_gain={position * factor:.4g}", f"controller.velocity_gain={velocity:.4g}",
        f"controller.{lead}",
        f"cmac.layers={draw.choose(8, 16, 32, 64, 128)}",
        f"cmac.resolution_elements={draw.choose(5, 9, 17, 33, 65)}",
        f"cmac.displacement={draw.choose('diagonal', 'diagonal', 'odd_lattice')}",
        f"cmac.addressing={draw.choose('hashed', 'visited')}", "cmac.memory_bytes=4000000",
        f"cmac.receptive_field={draw.choose('rectangular', 'rectangular', 'rectangular', 'linear', 'cubic')}",
        f"cmac.inputs={draw.choose('[angle]', '[angle,velocity]', '[angle,velocity,acceleration]')}",
    ]  # fmt: skip
    period = draw.choose(0.002, 0.004, 0.005, 0.005, 0.008, 0.01)
    samples = 20 * int(draw.uniform(1.5, 4.0) / period / 20)
    stiffness = draw.even_log(*soft_to_hard)
    elasticity = draw.even_log(0.1, 5.0) / stiffness
    return [
        *parts, f"sampling_period={period}", f"gait.cycle_time={samples * period:.6g}",
        f"gait.stroke={draw.uniform(0.05, 0.25):.3g}", f"gait.vertical={draw.choose('cubic', 'two_cubics')}",
        f"terrain.stiffness={stiffness:.4g}", f"force_control.elasticity={elasticity:.4g}",
        f"force_control.admittance={elasticity * draw.even_log(0.3, 2.0):.4g}",
    ]  # fmt: skip
