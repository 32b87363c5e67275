"""Margins: whether learning still holds where ground and masses are not those that were assumed."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from cmacexp.config import Config
from cmacexp.errors import BadInput
from cmacexp.stability.verdict import GROWS, HOLDS, UNDECIDED, Verdict, assess

MASSES = ("mass", "mass_1", "mass_2", "body_mass", "weight")
"""Fields of machines that are scaled."""


@dataclass(frozen=True)
class Corner:
    """One combination of ground and masses."""

    stiffness: float
    """Of the ground, over the one that is assumed."""
    masses: float
    """Over those of the config."""
    judgement: Verdict

    def describe(self) -> str:
        """In one line."""
        return f"stiffness x {self.stiffness:g}, masses x {self.masses:g}: {self.judgement.describe()}"

    def tabulate(self) -> dict[str, str | float]:
        """A row of a table, by the titles of its columns."""
        return {
            "stiffness, over the assumed": self.stiffness,
            "masses, over those of the run": self.masses,
            "learning": self.judgement.verdict,
            "growth": self.judgement.growth,
            "reasons": " ".join(self.judgement.reasons),
        }


def count_corners(corners: Sequence[Corner]) -> str:
    """How many corners hold, grow and are undecided, in a sentence."""
    verdicts = [corner.judgement.verdict for corner in corners]
    holds, grows, undecided = map(verdicts.count, (HOLDS, GROWS, UNDECIDED))
    return f"Of {len(verdicts)} corners learning holds in {holds}, grows in {grows}, is undecided in {undecided}."


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


def judge_corners(config: Config, share: float) -> list[Corner]:
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
                judgement = assess(corner)
            except BadInput as error:  # the plan cannot be walked with these masses
                judgement = Verdict(UNDECIDED, float("nan"), 0, (f"{error}.",))
            corners.append(Corner(stiffness, masses, judgement))
    return corners
