"""The configuration of plants in MuJoCo, unit and range beside every field."""

from dataclasses import dataclass

from cmacexp.config.fields import number


@dataclass
class MujocoLegConfig:
    """The leg on its stand in MuJoCo."""

    _target_: str
    substeps: int = number("", at_least=1, at_most=10000)
    """Runge-Kutta steps per sampling period."""


@dataclass
class MujocoQuadrupedConfig:
    """Four legs under a body that really moves, in MuJoCo."""

    _target_: str
    substeps: int = number("", at_least=1, at_most=10000)
    """Runge-Kutta steps per sampling period."""
    friction: float = number("", above=0, at_most=10)
    """Tangential over normal force of a foot at most."""
    friction_stiffness: float = number("N/m", above=0, at_most=1e6)
    """Of the spring that holds a foot where it sticks."""
    friction_damping: float = number("N s/m", at_least=0, at_most=1e4)
    """Of the damper beside that spring."""
    body_inertia: list[float] = number("kg m^2", above=0, at_most=1e3)
    """Of the body without its legs about its x, y and z."""
    start_spread: float = number("rad", at_least=0, at_most=0.5)
    """Joint angles start at most so far from the planned ones."""
    start_seed: int = number("", at_least=0, below=2**32)
    """Draws where they start."""
