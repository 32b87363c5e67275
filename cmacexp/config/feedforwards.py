"""Fields of the feedforwards that have some."""

from dataclasses import dataclass

from cmacexp.config.fields import choice, number

INPUTS = ("angle", "velocity", "acceleration")
"""Planned joint values that a network can look at."""


@dataclass
class InverseDynamicsConfig:
    """Inverse dynamics with a model of the legs that may be wrong."""

    _target_: str
    mass_factor: float = number("", above=0, at_most=1e3)
    """Masses of the model over the true ones."""
    length_factor: float = number("", above=0, at_most=1e3)
    """Lengths of the model's links over the true ones; joint angles are planned with the true ones."""


@dataclass
class RadialBasisConfig:
    """Normalised Gaussians along the planned path (Moody & Darken 1989, Sanner & Slotine 1992)."""

    _target_: str
    inputs: list[str] = choice(*INPUTS)
    centres: int = number("", at_least=1, at_most=4096)
    """Gaussians of one leg, spread evenly over its path."""
    active: int = number("", at_least=1, at_most=4096)
    """Nearest Gaussians that count at a sample."""
    width: float = number("", above=0, at_most=1e3)
    """Standard deviation of a Gaussian over the mean distance between neighbouring centres."""


@dataclass
class PerceptronConfig:
    """A perceptron with one hidden layer, of scikit-learn (Kawato, Furukawa & Suzuki 1987)."""

    _target_: str
    inputs: list[str] = choice(*INPUTS)
    hidden: int = number("", at_least=1, at_most=4096)
    """Neurons of the hidden layer."""
    passes: int = number("", at_least=1, at_most=1000)
    """Over the samples of a cycle, at its end."""
    batch: int = number("samples", at_least=1, at_most=2**24)
    """Samples of one step of the gradient."""
    step_size: float = number("", above=0, at_most=10)
    """Of Adam (Kingma & Ba 2015)."""


@dataclass
class IterativeLearningConfig:
    """Iterative learning control (Bristow, Tharayil & Alleyne 2006)."""

    _target_: str
    cutoff: float | None = number("Hz", above=0, at_most=1e6)
    """Of the low-pass Q that the torques of a cycle go through, where its gain is 1/sqrt(2); null: none."""
