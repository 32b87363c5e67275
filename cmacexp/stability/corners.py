"""Margins: whether learning still holds where ground and masses are not those that were assumed."""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, NamedTuple

from cmacexp.config import Config
from cmacexp.errors import BadInput
from cmacexp.loop.scenario import make_scenario
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import MAX_CYCLES_BEFORE, calmest, change_sizes, predicted_growth
from cmacexp.stability.lifted import lift, unguarded

MASSES = ("mass", "mass_1", "mass_2", "body_mass", "weight")
"""Fields of machines that are scaled."""
HOLDS, GROWS, UNDECIDED = "holds", "grows", "undecided"
CLEARLY = 1.001
"""Growth per cycle from which on learning grows for certain."""


class Judged(NamedTuple):
    """Whether learning holds, and why."""

    verdict: str
    """HOLDS, GROWS or UNDECIDED."""
    growth: float
    """Per cycle; NaN if unknown."""
    lead: int
    reasons: tuple[str, ...]


def judge(config: Config) -> Judged:
    """Judge the learning of a config, without its guard, by the linearised cycle, its lifted map, and Re z^lead T."""
    config = unguarded(make_scenario(config))
    lead, rate = int(config.learning.lead), float(config.learning.rate)
    first = config.learning.start_cycle
    sizes = change_sizes(config, first + MAX_CYCLES_BEFORE)
    if len(sizes) < first + MAX_CYCLES_BEFORE - 1:
        return Judged(GROWS, float("inf"), lead, (f"the run ends in cycle {len(sizes) + 1}",))
    try:
        cycle = calmest(sizes, first)
        growth, lifted = predicted_growth(config, cycle), lift(config, cycle)
    except NotPredictable as error:
        return Judged(UNDECIDED, float("nan"), lead, (str(error),))
    lasting, least = lifted.lasting_growth(lead, rate), lifted.find_least_real(lead)
    factors = (growth.per_cycle, float(abs(growth.krylov.eigenvalues()[0])), lasting)
    grows, holds = min(factors) > CLEARLY, max(factors) < 1.0 and least > 0.0
    named = f"growth {min(factors):.4f} to {max(factors):.4f}, least Re T {least:.2g}"
    return Judged(GROWS if grows else HOLDS if holds else UNDECIDED, max(factors), lead, (named,))


@dataclass(frozen=True)
class Corner:
    """One combination of ground and masses."""

    stiffness: float
    """Of the ground, over the one that is assumed."""
    masses: float
    """Over those of the config."""
    judgement: Judged

    def describe(self) -> str:
        """In one line."""
        verdict, reasons = self.judgement.verdict, "; ".join(self.judgement.reasons)
        return f"stiffness x {self.stiffness:g}, masses x {self.masses:g}: {verdict} ({reasons})"


def scale_masses(machine: Any, factor: float) -> Any:
    """The same machine with all masses, and the weight of a body, times ``factor``."""
    changed = {}
    for name in (field.name for field in fields(machine)):
        value = getattr(machine, name)
        if is_dataclass(value):
            changed[name] = scale_masses(value, factor)
        elif name in MASSES and value is not None:
            changed[name] = factor * value
    return replace(machine, **changed)


def judge_corners(config: Config, share: float, judged_by: Callable[[Config], Judged] = judge) -> list[Corner]:
    """Judge learning where stiffness and masses are less and more than the config says, by ``share`` of them.

    The stiffness that planner and controller assume and the gains stay; masses change for planner and plant alike,
    but those of a robot, which its model contains, not at all.
    """
    corners, factors = [], (1.0 - share, 1.0 + share)
    has_masses = scale_masses(config.machine, 2.0) != config.machine  # those of a robot are its model's
    for stiffness in factors:
        terrain = replace(
            config.terrain,
            stiffness=stiffness * config.terrain.stiffness,
            assumed_stiffness=config.assumed_stiffness,
        )
        for masses in factors if has_masses else (1.0,):
            corner = replace(config, terrain=terrain, machine=scale_masses(config.machine, masses))
            try:
                judgement = judged_by(corner)
            except BadInput as error:  # the plan cannot be walked with these masses
                judgement = Judged(UNDECIDED, float("nan"), 0, (str(error),))
            corners.append(Corner(stiffness, masses, judgement))
    return corners
