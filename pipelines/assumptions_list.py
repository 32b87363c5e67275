"""The values that Lin & Song 1997 do not give, and what else each could be."""

from collections.abc import Sequence
from typing import NamedTuple


class Assumption(NamedTuple):
    """A value that is taken, and others that could have been."""

    name: str
    keys: Sequence[str]
    """Of the config, all set to the same value."""
    values: Sequence[str]
    """Others than the one taken, as the command line takes them."""
    quick: bool = False
    """Whether the quick form tries its first value."""

    def overrides(self, value: str) -> list[str]:
        """Of the command line."""
        return [f"{key}={value}" for key in self.keys]


def _knees(name: str, legs: Sequence[str], value: str) -> Assumption:
    """Knees of two legs of the quadruped, bent to the other side."""
    return Assumption(name, [f"machine.legs.{leg}.knee" for leg in legs], [value])


def _lead(*omegas: str) -> list[Assumption]:
    """Corner frequencies of the compensator."""
    return [
        Assumption("LEAD omega", ["controller.lead_omega"], omegas, quick=True),
        Assumption("LEAD alpha", ["controller.lead_alpha"], ["5", "20"]),
    ]


VERTICAL = Assumption("vertical path", ["gait.vertical"], ["two_cubics"])


def _cmac(inputs: Sequence[str], ranges: Sequence[str], shifts: Sequence[str], memory: int) -> list[Assumption]:
    """What the paper leaves open of its CMAC; words of half the length give as many rows as twice the memory."""
    return [
        Assumption("CMAC inputs", ["cmac.inputs"], inputs),
        Assumption("CMAC range", ["cmac.range_factor"], ranges, quick=True),
        Assumption("CMAC displacement", ["cmac.displacement"], shifts),
        Assumption("memory of 4-byte words", ["cmac.memory_bytes"], [str(2 * memory)]),
    ]


ONE_LEG = [
    Assumption("knee", ["machine.leg.knee"], ["forward"]),
    Assumption("stroke", ["gait.stroke"], ["0.1", "0.15", "0.25", "0.3"]),
    Assumption("lift", ["gait.lift"], ["0.12", "0.2"], quick=True),
    VERTICAL,
    *_lead("2.5", "10", "20"),
    *_cmac(["[angle]", "[angle,velocity]"], ["2", "3", "10"], ["odd_lattice", "parks_militzer"], 2**20),
]
QUADRUPED = [
    _knees("front knees", ["left_front", "right_front"], "back"),
    _knees("rear knees", ["left_rear", "right_rear"], "forward"),
    Assumption("cycle time", ["gait.cycle_time"], ["2", "4"]),
    Assumption("stroke", ["gait.stroke"], ["0.2", "0.25", "0.35"]),
    Assumption("lift", ["gait.lift"], ["0.05", "0.15"]),
    VERTICAL,
    Assumption("touch-down", ["gait.touch_down"], ["[0.5,0,0.3,0.8]", "[0.1,0.6,0.9,0.4]", "[0,0.5,0.75,0.25]"]),
    Assumption("load ramp", ["gait.load_ramp"], ["0.12"]),
    Assumption("hip height", ["machine.hip_height"], ["0.45", "0.55"]),
    Assumption("weight", ["machine.weight"], ["49.05"], quick=True),
    Assumption("reference", ["reference"], ["literal"]),
    Assumption("learns from cycle", ["learning.start_cycle"], ["3"]),
    *_lead("5", "20"),
    *_cmac(["[angle]", "[angle,velocity,acceleration]"], ["2", "5"], ["odd_lattice"], 2**18),
]
POINT_MASS = [
    Assumption("start clearance", ["machine.start_clearance"], ["0.02", "0.1"], quick=True),
    *_lead("2.5", "10"),
]
"""Of the point mass under the force control methods (section 3)."""
