"""Fields of the ground under the machine and of the payload on its body."""

from dataclasses import dataclass

from cmacexp.config.fields import number
from cmacexp.config.machine import HAS_BODY

MOVES = ("machine.kind != 'point_mass' or gait.stroke > 0 or option.sensors != 'perfect'",)
"""What a slope needs: a point mass that stands on its spot meets the ground at one height."""


@dataclass
class TerrainConfig:
    """Elastic ground (Lin & Song 1997, eq. 1). The plan knows its stiffness, with ``load_rate`` its damping too."""

    stiffness: float = number("N/m", at_least=1e-3, at_most=1e9)
    """K_n, the stiffness that the plant feels."""
    assumed_stiffness: float | None = number("N/m", at_least=1e-3, at_most=1e9)
    """The K_n that planner and controller assume; null: the true one, before any step of it."""
    patch_size: float = number("m", at_least=1e-3, needs=("own.patch_spread > 0",))
    """Side of the square patches of the ground."""
    patch_spread: float = number("", at_least=0, below=1)
    """Each patch has K_n times a factor between 1 - spread and 1 + spread; 0: the same everywhere."""
    patch_seed: int = number("", at_least=0, below=2**32, needs=("own.patch_spread > 0",))
    """Seed of the patches."""
    damping: float = number("N s/m", at_least=0, at_most=1e9)
    """Force of the ground over the speed at which it is pressed in; 0 as in the paper. The ground never pulls."""
    step_time: float | None = number("s", at_least=0, needs=("own.step_factor != 1",))
    """When the stiffness steps; null: never."""
    step_factor: float = number("", at_least=1e-3, at_most=1e3, needs=("own.step_time is not None",))
    """K_n after the step over that before it."""
    step_legs: list[int] | None = number(
        "", at_least=1, at_most=4, needs=("own.step_time is not None", "own.step_factor != 1", *HAS_BODY)
    )
    """Legs under which it steps, by their numbers; null: all."""
    slope: float = number("", above=-1, below=1, needs=MOVES)
    """Rise of the ground over distance, m/m; 0: flat. Its vertical stiffness is that of flat ground."""
    slope_start: float = number("m", needs=("own.slope != 0", *MOVES))
    """Where the slope begins, x in the world; flat before. The body's centre starts at 0."""


@dataclass
class PayloadConfig:
    """A weight that is put on the body during a run; planner and controller do not know of it."""

    weight: float = number("N", at_least=0)
    """Of the payload; 0: none."""
    x: float = number("m", needs=("own.weight > 0",))
    """Where it lies on the body, forward of its centre, in the plane of the hips."""
    y: float = number("m", needs=("own.weight > 0",))
    """Where it lies on the body, to the left."""
    time: float = number("s", at_least=0, needs=("own.weight > 0",))
    """When it is put there."""
