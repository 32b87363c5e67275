"""Joint search over what Lin & Song 1997 leave open: random settings from stated ranges, and what they measure.

Each setting draws every open value at once. ``python -m pipelines.paper_settings`` runs the search.
"""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from cmacexp.engine.driver import map_runs
from cmacexp.engine.workers import start_workers
from cmacexp.jit.compiler import expect_runs
from cmacexp.planning import Recall
from pipelines.paper_claims import FEEDBACK, LEG, MASS, WALK, Claim
from pipelines.paper_measures import measure_leg, measure_mass, measure_walk

Range = Mapping[str, Sequence[str]]
"""Values of an open quantity, the plain reading first, by the config keys that they set, joined by a space."""
FORMS = ["[" + ",".join(map(str, form)) + "]" for form in itertools.product((1, 0, -1), repeat=4)]
"""All forms of G with factors -1, 0 and 1 of its four terms, the printed one first."""
GRAVITY, INPUTS = "plant.gravity_factors", "cmac.inputs"
COMMON: Range = {
    GRAVITY: FORMS,
    "learning.lead": ["0", "-1", "1"],
    "controller.lead_alpha": ["10", "5", "20"],
    "controller.lead_gain": ["1", "0.5", "2"],
    "controller.lead_reset": ["false", "true"],
    "force_control.switch": ["plan", "contact"],
    "gait.transfer_depth": ["1", "0", "1.5"],
    "gait.vertical": ["cubic", "two_cubics"],
    "cmac.weight_type": ["float64", "int16", "int8"],
}
LEG_RANGES: Range = {
    **COMMON,
    "controller.lead_omega": ["5", "2.5", "7", "10", "14", "20"],
    INPUTS: ["[angle,velocity,acceleration]", "[angle,velocity]", "[angle]"],
    "cmac.range_factor": ["5", "2", "3", "10"],
    "gait.stroke": ["0.2", "0.1", "0.15", "0.3"],
    "gait.lift": ["0.16", "0.12", "0.2"],
    "machine.leg.knee": ["back", "forward"],
}
WALK_RANGES: Range = {
    **COMMON,
    "controller.lead_omega": ["10", "5", "7", "14", "20"],
    INPUTS: ["[angle,velocity]", "[angle]", "[angle,velocity,acceleration]"],
    "cmac.range_factor": ["3", "2", "5", "10"],
    "gait.stroke": ["0.3", "0.25", "0.35"],
    "gait.lift": ["0.1", "0.05", "0.15"],
    "gait.cycle_time": ["3", "2", "4"],
    "gait.touch_down": ["null", "[0.5,0,0.3,0.8]", "[0.1,0.6,0.9,0.4]"],
    "machine.hip_height": ["0.5", "0.45", "0.55"],
    "machine.weight": ["40", "49.05"],
    "reference": ["literal", "aware"],
    "machine.legs.left_front.knee machine.legs.right_front.knee": ["forward", "back"],
    "machine.legs.left_rear.knee machine.legs.right_rear.knee": ["back", "forward"],
}
MASS_RANGES: Range = {
    "machine.mass": ["0.5", "0.75", "1.0"],
    "machine.start_clearance": ["0.05", "0.02", "0.1"],
    "controller.lead_omega": ["5", "2.5", "7", "10", "14", "20"],
    "controller.lead_alpha": ["10", "5", "20"],
    "controller.lead_gain": ["1", "0.5", "2"],
}
FOUND: Mapping[str, Mapping[str, str]] = {
    "leg": {GRAVITY: "[0,-1,-1,1]", INPUTS: "[angle]", "gait.vertical": "two_cubics"},
    "walk": {
        GRAVITY: "[0,-1,-1,1]",
        INPUTS: "[angle]",
        "gait.vertical": "two_cubics",
        "controller.lead_gain": "2",
        "reference": "aware",
    },
    "mass": {},
}
"""Values of the joint setting that differ from the plain reading.

Of the settings of one leg with all claims true and the fewest changes, that with the least error left in transfer.
The quadruped has these values and two more, chosen among all pairs for the most true claims; no command repeats
that choice.
"""
LEARNING = ("learning.lead", INPUTS, "cmac.range_factor", "cmac.weight_type")
"""Open values of one leg that do not act in cycle 1."""
FIXED = ("cmac.addressing=visited", "cmac.memory_bytes=67108864")
"""Memory without collisions, as the paper assumes."""
CHUNK = 100
"""Settings that a worker takes at a time."""


class Machine(NamedTuple):
    """A machine of the search."""

    ranges: Range
    claims: Mapping[str, Claim]
    measure: Callable[[Sequence[str], Recall], dict[str, float]]
    fixed: Sequence[str]
    """Overrides of all its runs."""
    settings: int
    """Number of settings of the full search."""


MACHINES = {
    "leg": Machine(LEG_RANGES, LEG, measure_leg, FIXED, 20_000),
    "walk": Machine(WALK_RANGES, WALK, measure_walk, FIXED, 2_000),
    "mass": Machine(MASS_RANGES, MASS, measure_mass, (), 400),
    "feedback": Machine(
        LEG_RANGES,
        {name: LEG[name] for name in FEEDBACK},
        partial(measure_leg, cycles=(1,)),
        (*FIXED, "feedforward=none"),
        0,
    ),
}
"""Machines of the search; ``feedback`` is one leg in its first cycle, before the network acts."""


def list_overrides(setting: Mapping[str, str]) -> list[str]:
    """Return the overrides of a setting, the values of which may set several keys each."""
    return [f"{key}={value}" for keys, value in setting.items() for key in keys.split()]


def read_plainly(ranges: Range) -> dict[str, str]:
    """Return the plain reading: the first value of every range."""
    return {key: values[0] for key, values in ranges.items()}


def draw_settings(ranges: Range, count: int) -> list[dict[str, str]]:
    """Draw ``count`` joint settings, every value uniformly from its range; the first is the plain reading."""
    rng = np.random.default_rng(0)
    drawn = [{key: str(rng.choice(values)) for key, values in ranges.items()} for _ in range(count - 1)]
    return [read_plainly(ranges), *drawn]


def list_neighbours(ranges: Range, most: int) -> Iterator[dict[str, str]]:
    """List all settings that differ in up to ``most`` values from the plain reading."""
    plain = read_plainly(ranges)
    for changed in itertools.chain.from_iterable(itertools.combinations(ranges, n) for n in range(most + 1)):
        for values in itertools.product(*(ranges[key][1:] for key in changed)):
            yield plain | dict(zip(changed, values, strict=True))


def search_near(most: int) -> pd.DataFrame:
    """Measure all settings of one leg that differ from the plain reading in up to ``most`` values.

    Settings that fail a claim on cycle 1 are left out: whether they do is measured once for all values of LEARNING.
    """
    settings = list(list_neighbours(LEG_RANGES, most))
    keys = [key for key in LEG_RANGES if key not in LEARNING]
    first = {tuple(setting[key] for key in keys): setting for setting in settings}
    holds = search("feedback", list(first.values()))[[f"holds:{name}" for name in FEEDBACK]].all(axis=1)
    fitting = set(itertools.compress(first, holds))
    return search("leg", [setting for setting in settings if tuple(setting[key] for key in keys) in fitting])


def measure_chunk(machine: str, settings: Sequence[Mapping[str, str]], runs: int) -> list[dict[str, float]]:
    """Measure some of ``runs`` settings of a machine."""
    expect_runs(runs)
    _, _, measure, fixed, _ = MACHINES[machine]
    recall = Recall()  # neighbours share plans
    return [measure([*fixed, *list_overrides(setting)], recall) for setting in settings]


def search(machine: str, settings: Sequence[Mapping[str, str]]) -> pd.DataFrame:
    """Measure settings of a machine on all cores: their values, quantities, and ``holds:NAME`` for each claim."""
    items = [(machine, settings[first : first + CHUNK], len(settings)) for first in range(0, len(settings), CHUNK)]
    with start_workers() as workers:
        chunks = dict(map_runs(measure_chunk, items, workers, machine, len(settings), lambda item: len(item[1])))
    measured = itertools.chain.from_iterable(chunks[number] for number in range(len(items)))
    claims = MACHINES[machine].claims
    return pd.DataFrame(
        {
            **setting,
            **values,
            "completed": bool(values),
            **{f"holds:{name}": claim.holds(values) for name, claim in claims.items()},
        }
        for setting, values in zip(settings, measured, strict=True)
    )
