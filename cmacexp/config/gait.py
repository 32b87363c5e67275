"""Gaits: which legs touch down when, and the fields that shape the motion of a foot."""

from dataclasses import dataclass, field
from typing import NamedTuple

from cmacexp.config.fields import choice, number


class GaitPattern(NamedTuple):
    """When the feet of a gait touch down, and what the gait needs."""

    touch_downs: tuple[tuple[float, float], ...]
    """(a, b) for each leg: it touches down at a + b x duty factor of the cycle, modulo 1."""
    lifts: bool = True
    """False: the feet support all the time."""
    least_duty_factor: float = 0.0
    """Below it the gait is not statically stable."""
    divisor: int = 1
    """The number of steps of a cycle must be a multiple of this."""
    cycle_time: float = 0.0
    """Longest cycle of a robot, s."""
    stroke: float = 0.0
    """Stroke of a robot without `gait.speed`, m."""
    overlap: float = 0.0
    """Share of the cycle for which a rear foot of a robot is down before the front foot of its side lifts."""
    gain: float = 0.0
    """Least feedback gain that a robot needs for it, over the largest one at a sampling period of 1 ms."""

    @property
    def is_dynamic(self) -> bool:
        """Whether four legs walk on two feet at times, which no static equilibrium allows."""
        return self.lifts and self.legs > 1 and not self.least_duty_factor

    @property
    def legs(self) -> int:
        """Number of legs."""
        return len(self.touch_downs)


PATTERNS = {
    "transfer_first": GaitPattern(((1.0, -1.0),)),
    "standing": GaitPattern(((0.0, 0.0),), lifts=False),
    "wave": GaitPattern(((0.0, 0.0), (0.5, 0.0), (0.0, 1.0), (0.5, 1.0)), True, 0.75, 2, 2.0, 0.12, overlap=0.05),
    "walk": GaitPattern(((0.0, 0.0), (0.5, 0.0), (0.75, 0.0), (0.25, 0.0)), True, 0.0, 4, 0.8, 0.1, gain=0.9),
    "amble": GaitPattern(((0.0, 0.0), (0.5, 0.0), (0.75, 0.0), (0.25, 0.0)), True, 0.0, 4, 0.4, 0.1, gain=1.8),
    "trot": GaitPattern(((0.0, 0.0), (0.5, 0.0), (0.5, 0.0), (0.0, 0.0)), True, 0.0, 2, 0.4, 0.1, gain=0.9),
    "pace": GaitPattern(((0.0, 0.0), (0.5, 0.0), (0.0, 0.0), (0.5, 0.0)), True, 0.0, 2, 0.4, 0.1, gain=1.8),
}
"""``transfer_first``: one leg, a cycle begins with lift-off. ``standing``: one leg. ``wave``: four legs; those of one
side follow those of the other by half a cycle, and a rear foot touches down when the front foot of its side lifts
(Lin & Song 1997, Fig. 14; the start of the cycle is assumed). The others are those of robots: ``walk`` and ``amble``
by single feet, with three and two feet down, ``trot`` by diagonal pairs, ``pace`` by those of a side."""
LINEAR, COSINE = "linear", "cosine"
"""Shapes of the ramps of the load."""
LIFTS = (f"own.pattern in {tuple(name for name, pattern in PATTERNS.items() if pattern.lifts)}",)
"""What fields of the transfer need."""
UNSTABLE = " or ".join(
    f"own.pattern == {name!r} and (own.duty_factor < {pattern.least_duty_factor:g} or own.touch_down is not None)"
    for name, pattern in PATTERNS.items()
    if pattern.least_duty_factor
)
"""What the permission to run a gait that is not statically stable needs."""


@dataclass
class GaitConfig:
    """When and along which path the feet move."""

    pattern: str = choice(*PATTERNS)
    """transfer_first: one leg, a cycle begins with lift-off; standing: one leg, no transfer; wave: four legs, a
    statically stable walk; walk, amble, trot, pace: four legs of a robot, two feet down at times."""
    touch_down: list[float] | None = number("cycles", at_least=0, below=1)
    """Touch-down of each leg within the cycle; null: given by the pattern."""
    cycle_time: float = number("s", at_least=1e-3, at_most=1e5)
    """Duration of a gait cycle, T."""
    duty_factor: float = number("", above=0, at_most=1)
    """Fraction of the cycle in which a foot supports."""
    speed: float | None = number("m/s", at_least=0)
    """Speed of a robot, from which its stroke and cycle follow; null: they determine it."""
    stroke: float = number("m", at_least=0)
    """Travel of the foot on the ground during support (assumed)."""
    lift: float = number("m", at_least=0, needs=LIFTS)
    """Apex of the transfer above the take-off point (assumed)."""
    vertical: str = choice("cubic", "two_cubics", needs=LIFTS)
    """cubic: one through both ends and the apex, its speed jumps (assumed); two_cubics: at rest at ends and apex."""
    load_ramp: float = number("s", at_least=0)
    """Time after touch-down over which a foot takes its desired force; 0: a step, as in the paper."""
    unload_ramp: float = number("s", at_least=0)
    """Time before the end of support over which a foot gives up its desired force; 0: a step, as in the paper."""
    ramp: str = choice(LINEAR, COSINE, needs=("own.load_ramp > 0 or own.unload_ramp > 0",))
    """Shape of both ramps; cosine: without a jump of the rate at either end."""
    allow_unstable: bool = field(kw_only=True, metadata={"needs": (UNSTABLE,)})
    """Run a gait of four legs that is not statically stable."""
