"""What the controller is fed in support, so that the foot presses with the desired force (eq. 9, 11, 13, 15).

Each law carries a term in 1/K_a: the error that feedback needs to hold a static load. Once a feedforward holds the
load the term makes the force too high by its share (4.88 % in the paper's one leg): ``static_load=False`` drops it.
"""

from typing import NamedTuple


class Gains(NamedTuple):
    """Gains that the reference laws know."""

    position_gain: float
    """K_ap, N/m."""
    velocity_gain: float
    """K_av, N s/m."""
    force_gain: float
    """K_a of explicit force control."""
    elasticity: float
    """P_fn, m/N."""
    admittance: float
    """V_fn, m/(N s)."""
    stiffness: float
    """K_n as the controller believes it, N/m."""


class SupportReference(NamedTuple):
    """Reference per newton of desired force; NaN where the method does not use it."""

    depression: float
    """D_r, m/N."""
    velocity: float
    """dY_r, m/(N s)."""
    force: float
    """F_r, N/N."""


NOT_USED = float("nan")


def stiffness_reference(gains: Gains, static_load: bool) -> SupportReference:
    """Stiffness control (Lin & Song 1997, eq. 9, which solves eq. 8 for the desired force)."""
    load = 1.0 / gains.position_gain if static_load else 0.0
    return SupportReference(1.0 / gains.stiffness + load + gains.elasticity, 0.0, NOT_USED)


def damping_reference(gains: Gains, static_load: bool) -> SupportReference:
    """Damping control (Lin & Song 1997, eq. 11, which solves eq. 10 for the desired force)."""
    load = 1.0 / gains.velocity_gain if static_load else 0.0
    return SupportReference(NOT_USED, gains.admittance + load, NOT_USED)


def combined_reference(gains: Gains, static_load: bool) -> SupportReference:
    """Combined stiffness and damping control (Lin & Song 1997, eq. 13, which solves eq. 12; eq. 24 per leg)."""
    load = 1.0 / gains.position_gain if static_load else 0.0
    damping = gains.velocity_gain / gains.position_gain * gains.admittance
    return SupportReference(1.0 / gains.stiffness + load + gains.elasticity + damping, 0.0, NOT_USED)


def explicit_reference(gains: Gains, static_load: bool) -> SupportReference:
    """Explicit force control (Lin & Song 1997, eq. 15, which solves eq. 14 for the desired force)."""
    load = 1.0 / gains.force_gain if static_load else 0.0
    return SupportReference(NOT_USED, 0.0, 1.0 + load)


SUPPORT_REFERENCES = {
    "stiffness": stiffness_reference,
    "damping": damping_reference,
    "combined": combined_reference,
    "explicit": explicit_reference,
}


def keeps_static_load(reference: str, feedforward_acts: bool) -> bool:
    """Whether the 1/K_a term stands: ``literal`` always, ``aware`` until a feedforward acts, else never."""
    return reference == "literal" or (reference == "aware" and not feedforward_acts)
