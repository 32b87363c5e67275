"""Gait patterns, and the fields for timing and path of the feet."""

from dataclasses import dataclass, field
from typing import NamedTuple

from cmacexp.config.fields import choice, number

SHORTEST_RAMP_SAMPLES = 10
"""Duration of the shortest load ramp, samples: a sampled motion cannot follow a shorter one."""


class GaitPattern(NamedTuple):
    """Touch-down times of a gait, and its requirements."""

    touch_downs: tuple[tuple[float, float], ...]
    """(a, b) for each leg, which touches down at the fraction a + b x duty factor of the cycle, modulo 1."""
    lifts: bool = True
    """True if the feet lift off; False: they support during the whole cycle."""
    least_duty_factor: float = 0.0
    """Smallest duty factor of a statically stable gait; 0: the gait is not statically stable, or has one leg."""
    divisor: int = 1
    """Divisor of the number of steps per cycle, so that all touch-downs fall on samples."""
    cycle_time: float = 0.0
    """Longest cycle of a robot, s; 0: not for robots."""
    stroke: float = 0.0
    """Stroke of a robot if ``gait.speed`` is null, m; 0: not for robots."""
    overlap: float = 0.0
    """Fraction of the cycle from touch-down of a rear foot to lift-off of the front foot on its side, for robots."""
    gain: float = 0.0
    """Smallest feedback gain that robots need for this gait, over the largest one at a sampling period of 1 ms."""

    @property
    def is_dynamic(self) -> bool:
        """True for a gait of four legs with phases on two feet, in which the body has no static equilibrium."""
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
"""``transfer_first``: one leg, a cycle begins with lift-off. ``standing``: one leg, no transfer. ``wave``: four legs;
the two sides are half a cycle apart, and a rear foot touches down when the front foot on its side lifts off (Lin &
Song 1997, Fig. 14; the start of the cycle is assumed). The other gaits are for robots: ``walk`` and ``amble`` lift
one foot after the other, with three or two feet down; ``trot`` lifts diagonal pairs, ``pace`` those of one side."""
LINEAR, COSINE = "linear", "cosine"
"""Shapes of the load ramps."""
LIFTS = (f"own.pattern in {tuple(name for name, pattern in PATTERNS.items() if pattern.lifts)}",)
"""Condition for an effect of the fields of transfer."""
UNSTABLE = " or ".join(
    f"own.pattern == {name!r} and (own.duty_factor < {pattern.least_duty_factor:g} or own.touch_down is not None)"
    for name, pattern in PATTERNS.items()
    if pattern.least_duty_factor
)
"""Condition for an effect of ``gait.allow_unstable``."""


@dataclass
class GaitConfig:
    """Timing and path of the feet."""

    pattern: str = choice(*PATTERNS)
    """transfer_first: one leg, a cycle begins with lift-off; standing: one leg, no transfer; wave: four legs,
    statically stable; walk, amble, trot, pace: robots, with phases on two feet."""
    touch_down: list[float] | None = number("cycles", at_least=0, below=1)
    """Touch-down time of each leg, as a fraction of the cycle; null: that of the pattern."""
    cycle_time: float = number("s", at_least=1e-3, at_most=1e5)
    """Duration of a gait cycle, T."""
    duty_factor: float = number("", above=0, at_most=1)
    """Fraction of the cycle in which a foot is in support."""
    speed: float | None = number("m/s", at_least=0)
    """Walking speed of a robot, which determines stroke and cycle; null: these determine the speed."""
    stroke: float = number("m", at_least=0)
    """Travel of a foot relative to the body during support (assumed)."""
    lift: float = number("m", at_least=0, needs=LIFTS)
    """Height of the apex of the transfer above the lift-off point (assumed)."""
    vertical: str = choice("cubic", "two_cubics", needs=LIFTS)
    """Vertical path in transfer; cubic: one polynomial through both ends and the apex, velocity jumps at the ends
    (assumed); two_cubics: zero velocity at the ends and the apex."""
    load_ramp: float = number("s", at_least=0)
    """Time after touch-down over which the desired force rises from 0; 0: a step, as in the paper."""
    unload_ramp: float = number("s", at_least=0)
    """Time before lift-off over which the desired force falls to 0; 0: a step, as in the paper."""
    ramp: str = choice(LINEAR, COSINE, needs=("own.load_ramp > 0 or own.unload_ramp > 0",))
    """Shape of both load ramps; cosine: the rate of the force is continuous."""
    transfer_depth: float = number("", at_least=0, at_most=10, needs=LIFTS, default=1.0)
    """Depth at which the transfer of one leg starts and ends, over the depression under the desired force (assumed);
    0: on the undepressed ground."""
    allow_unstable: bool = field(kw_only=True, metadata={"needs": (UNSTABLE,)})
    """Allow a wave gait whose duty factor or touch-down times do not make it statically stable."""
    width: float | None = number("m", above=0, default=None, needs=("machine.kind == 'robot'",))
    """Distance between left and right feet of a robot; null: by the hip angle of ``machine.home``."""
