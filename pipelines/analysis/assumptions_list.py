"""The values that Lin & Song 1997 do not give, and what else each could be."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipelines.analysis.measured import flat, short


@dataclass(frozen=True)
class Assumption:
    """A value that is taken, and others that could have been."""

    name: str
    keys: tuple[str, ...]
    """Of the config, all set to the same value."""
    values: tuple[str, ...]
    """Others than the one taken, as the command line takes them."""
    unit: str = ""
    words: Mapping[str, str] = field(default_factory=dict)
    """For values that do not speak for themselves, also the one taken."""
    quick: bool = False
    """Whether the quick form tries its first value."""

    def label(self, value: str) -> str:
        """A value in words."""
        return self.words.get(value) or f"{value} {self.unit}".strip()

    def taken(self, config: Mapping[str, Any]) -> str:
        """The value that ``config`` takes, in words."""
        return self.label(short(flat(config)[self.keys[0]]))

    def overrides(self, value: str) -> list[str]:
        """Of the command line."""
        return [f"{key}={value}" for key in self.keys]


def knees(name: str, legs: Sequence[str], value: str) -> Assumption:
    """Knees of two legs of the quadruped, bent to the other side."""
    return Assumption(name, tuple(f"machine.legs.{leg}.knee" for leg in legs), (value,))


def lead(*omegas: str) -> tuple[Assumption, ...]:
    """Corner frequencies of the compensator."""
    omega = Assumption("LEAD ω", ("controller.lead_omega",), omegas, "rad/s", quick=True)
    return omega, Assumption("LEAD α", ("controller.lead_alpha",), ("5", "20"))


INPUT_NAMES = {
    "[angle]": "angle",
    "[angle,velocity]": "angle, velocity",
    "[angle,velocity,acceleration]": "all three",
}
SHIFT_NAMES = {"odd_lattice": "odd lattice", "parks_militzer": "Parks & Militzer"}
SEEDS = Assumption("seed of the hash", ("seed",), ("1", "2"))
VERTICAL = Assumption("vertical path", ("gait.vertical",), ("two_cubics",), words={"two_cubics": "two cubics"})


def cmac(
    inputs: tuple[str, ...], factors: tuple[str, ...], shifts: tuple[str, ...], memory: int
) -> tuple[Assumption, ...]:
    """What the paper leaves open of its CMAC; words of half the length give as many rows as twice the memory."""
    words = {str(memory): "8 bytes", str(2 * memory): "4 bytes"}
    return (
        Assumption("CMAC inputs", ("cmac.inputs",), inputs, words=INPUT_NAMES),
        Assumption("CMAC range", ("cmac.range_factor",), factors, "× span", quick=True),
        Assumption("CMAC shifts", ("cmac.displacement",), shifts, words=SHIFT_NAMES),
        Assumption("CMAC word", ("cmac.memory_bytes",), (str(2 * memory),), words=words),
        SEEDS,
    )


ONE_LEG = (
    Assumption("knee", ("machine.leg.knee",), ("forward",)),
    Assumption("stroke", ("gait.stroke",), ("0.1", "0.15", "0.25", "0.3"), "m"),
    Assumption("lift", ("gait.lift",), ("0.12", "0.2"), "m", quick=True),
    VERTICAL,
    *lead("2.5", "10", "20"),
    *cmac(("[angle]", "[angle,velocity]"), ("2", "3", "10"), ("odd_lattice", "parks_militzer"), 2**20),
)
QUADRUPED = (
    *(
        knees("front knees", ("left_front", "right_front"), "back"),
        knees("rear knees", ("left_rear", "right_rear"), "forward"),
    ),
    Assumption("cycle time", ("gait.cycle_time",), ("2", "4"), "s"),
    Assumption("stroke", ("gait.stroke",), ("0.2", "0.25", "0.35"), "m"),
    Assumption("lift", ("gait.lift",), ("0.05", "0.15"), "m"),
    VERTICAL,
    Assumption(
        "touch-down",
        ("gait.touch_down",),
        ("[0.5,0.0,0.3,0.8]", "[0.1,0.6,0.9,0.4]", "[0.0,0.5,0.75,0.25]"),
        words={
            "null": "as front lifts",
            "[0.5,0.0,0.3,0.8]": "right side first",
            "[0.1,0.6,0.9,0.4]": "0.1 cycle later",
            "[0.0,0.5,0.75,0.25]": "evenly spread",
        },
    ),
    Assumption("load ramp", ("gait.load_ramp",), ("0.12",), "s"),
    Assumption("hip height", ("machine.hip_height",), ("0.45", "0.55"), "m"),
    Assumption("weight", ("machine.weight",), ("49.05",), "N", quick=True),
    Assumption("reference law", ("reference",), ("literal",)),
    Assumption("learns from cycle", ("learning.start_cycle",), ("3",)),
    *lead("5", "20"),
    *cmac(("[angle]", "[angle,velocity,acceleration]"), ("2", "5"), ("odd_lattice",), 2**18),
)
METHODS = (
    Assumption("clearance at the start", ("machine.start_clearance",), ("0.02", "0.1"), "m", quick=True),
    *lead("2.5", "10"),
)
"""Of the point mass under the force control methods (section 3)."""
