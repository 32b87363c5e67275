"""Worlds, i.e. randomised runs: ground, masses, start, sensors and hash vary, unknown to planner and controller."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from cmacexp.study import Request, grid
from cmacexp.study.study import Values

WORLDS = "world"
"""The label of their runs."""
STIFFNESS = {"one_leg": 10.0, "quadruped": 1e4, "quadruped_lasting": 1e4}
"""That the plan assumes, N/m, by scenario; robots' follows from their model."""
PATCH = {"one_leg": 0.1, "quadruped": 0.15, "quadruped_lasting": 0.15, "robot": 0.1}
"""Side of a patch of ground, m."""
START = {"one_leg": 0.05, "quadruped": 0.01, "quadruped_lasting": 0.01, "robot": 0.02}
"""Largest difference of the joint angles at the start from the planned ones, rad."""
FIRST_TUNING = 1_000_000
"""Number of the first world that settings are tuned in: none of those that they are tested in."""
TESTED, TUNED = range(24), range(FIRST_TUNING, FIRST_TUNING + 4)
"""Numbers of the worlds that studies test in, and tune in."""
FEWER = TESTED[:12]
"""Those in which long runs are tested."""


def draw_world(scenario: str, number: int, stiffer: float = 1.0) -> tuple[str, ...]:
    """Overrides of a world; the same number is the same world, whatever learns in it.

    Args:
        scenario: ``one_leg``, ``quadruped``, ``quadruped_lasting`` or ``robot``.
        number: of the world; seed of the hash of a network too.
        stiffer: how many times as stiff the ground has become, unknown to the plan; not of ``robot``.
    """
    chance = np.random.default_rng([2026, sorted(PATCH).index(scenario), number])
    ground: tuple[str, ...] = ()
    if scenario in STIFFNESS:
        known = STIFFNESS[scenario]
        true = stiffer * known * float(np.exp(chance.uniform(-0.3, 0.3)))
        ground = (f"terrain.stiffness={true:.5g}", f"terrain.assumed_stiffness={known:g}")
    # Gains of a robot by rule count the delay of its sensors: with none they leave no room for a later torque.
    return (
        f"seed={number}",
        *ground,
        *("terrain.patch_spread=0.2", f"terrain.patch_size={PATCH[scenario]}", f"terrain.patch_seed={number}"),
        f"plant.mass_factor={chance.uniform(0.8, 1.2):.4f}",
        *(f"plant.start_spread={START[scenario]}", f"plant.start_seed={number}"),
        "sensors=encoders",
        f"sensors.velocity.delay={max(chance.integers(2), scenario == 'robot'):d}",
        f"sensors.velocity.noise={np.exp(chance.uniform(np.log(0.005), np.log(0.05))):.4f}",
        f"sensors.force.noise_relative={chance.uniform(0.0, 0.1):.4f}",
    )


def in_worlds(
    scenario: str,
    numbers: Iterable[int],
    *overrides: str,
    over: Values | None = None,
    stiffer: float = 1.0,
    **labels: Any,
) -> list[Request]:
    """A request for every combination of values in each world, as :func:`cmacexp.study.grid` makes them."""
    return [
        request
        for number in numbers
        for request in grid(
            f"scenario={scenario}",
            *draw_world(scenario, number, stiffer),
            *overrides,
            over=over,
            **{WORLDS: number, **labels},
        )
    ]
