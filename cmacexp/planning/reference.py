"""Named arrays of a plan: the motion of feet or joints, and the reference that the controller follows.

In support the foot presses with the desired force where it follows the reference (eq. 9, 11, 13, 15). Each equation
has a term in 1/K_a: the error that feedback needs to hold a static load. Once a feedforward holds the load, the term
makes the force too high (by 4.88 % in the paper's one leg); ``static_load=False`` omits it.
"""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.jit.compiler import kernel
from cmacexp.models.ground import damped_depression, depression_for
from cmacexp.typing import Array, Mask

X, Y, Z = range(3)
"""Axes of a foot in the frame of its hip: forward, down, and to the left where feet move in space."""
BEFORE, ACTING = range(2)
"""Stages of a run, the first axis of a plan's ControlReference: before the feedforward acts, and while it acts."""


class Motion(NamedTuple):
    """Motion of feet or joints over a cycle, (N, L, J) each; in one step (L, J), along one axis (N,) or (N, L)."""

    position: Array
    """m; of joints rad."""
    velocity: Array
    """m/s; of joints rad/s."""
    acceleration: Array
    """m/s^2; of joints rad/s^2."""


class ControlReference(NamedTuple):
    """Reference of the controller; in one step without the axes of stages and samples, (L, J) and (L,)."""

    position: Array
    """(2, N, L, J): m; in support NaN along y where the method uses none."""
    velocity: Array
    """(2, N, L, J): m/s; in support NaN along y where the method uses none."""
    force_reference: Array
    """(2, N, L): F_r, N; in support NaN where the method uses none."""
    force_added: Array
    """(2, N, L): force added to the feedback, N."""
    force_desired: Array
    """(2, N, L): desired contact force, N."""


@kernel
def select(plan: ControlReference, stage: int, sample: int) -> ControlReference:
    """Return the reference of the controller in a ``sample`` of a ``stage``: views (L, J) and (L,)."""
    return ControlReference(
        plan.position[stage, sample],
        plan.velocity[stage, sample],
        plan.force_reference[stage, sample],
        plan.force_added[stage, sample],
        plan.force_desired[stage, sample],
    )


class Gains(NamedTuple):
    """Gains of position and force control, and the ground stiffness that the controller assumes."""

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
    """K_n that the controller assumes, N/m."""


def make_gains(config: Config, position_gain: float, velocity_gain: float) -> Gains:
    """Collect the gains of a config for a controller with ``position_gain``, N/m, and ``velocity_gain``, N s/m."""
    force = config.force_control
    return Gains(
        position_gain, velocity_gain, force.force_gain, force.elasticity, force.admittance, config.assumed_stiffness
    )


class SupportReference(NamedTuple):
    """Reference in support per newton of desired force; NaN where the method does not use it."""

    depression: float
    """D_r, m/N."""
    velocity: float
    """dY_r, m/(N s)."""
    force: float
    """F_r, N/N."""


NOT_USED = float("nan")


def compute_support_reference(method: str, gains: Gains, static_load: bool) -> SupportReference:
    """Compute the reference per newton for a ``method`` of force control, with or without its term in 1/K_a.

    Stiffness, damping, combined and explicit control have Lin & Song 1997, eq. 9, 11, 13, 15: in this order each
    solves eq. 8, 10, 12, 14 for the desired force. Eq. 24 is eq. 13 for each leg.
    """
    if method == "damping":
        load = 1.0 / gains.velocity_gain if static_load else 0.0
        return SupportReference(NOT_USED, gains.admittance + load, NOT_USED)
    if method == "explicit":
        load = 1.0 / gains.force_gain if static_load else 0.0
        return SupportReference(NOT_USED, 0.0, 1.0 + load)
    load = 1.0 / gains.position_gain if static_load else 0.0
    damping = gains.velocity_gain / gains.position_gain * gains.admittance if method == "combined" else 0.0
    return SupportReference(1.0 / gains.stiffness + load + gains.elasticity + damping, 0.0, NOT_USED)


def plan_reference(
    config: Config, support: Mask, hip_height: float, desired: Motion, force: Array
) -> ControlReference:
    """Plan the input of the controller: ``desired`` motion in transfer, eq. 9, 11, 13 or 15 in ``support`` (N, L).

    ``hip_height`` is in m, the desired ``force`` (N, L) in N.

    The equations have the term in 1/K_a always with ``literal``, until a feedforward acts with ``aware``, else
    never. For a controller without K_ap and K_av they omit it, as well as that in K_av/K_ap. With ``load_rate`` the
    reference follows the depression as the desired force changes: the velocity gain would resist that, and on ground
    with damping the depression lags behind.
    """
    method = config.force_control
    gains = make_gains(config, *(config.gains or (math.inf, 0.0)))
    none = np.zeros_like(force)
    reference = ControlReference(*(np.stack([values, values]) for values in (*desired[:2], none, none, force)))
    for stage in (BEFORE, ACTING):
        static_load = config.gains is not None and config.reference in ("literal", "aware" if stage == BEFORE else "")
        per_newton = compute_support_reference(method.method, gains, static_load)
        reference.position[stage, support, Y] = hip_height + per_newton.depression * force[support]
        reference.velocity[stage, support, Y] = per_newton.velocity * force[support]
        reference.force_reference[stage, support] = per_newton.force * force[support]
        if config.reference == "force_feedforward":
            reference.force_added[stage, support] = force[support]
    if method.load_rate:
        period = config.sampling_period
        depression = damped_depression(gains.stiffness, config.terrain.damping, force, support, period)
        # The cycle repeats. Where the depression jumps, its rate is high for two samples.
        rate = (np.roll(depression, -1, axis=0) - np.roll(depression, 1, axis=0)) / (2.0 * period)
        reference.position[:, support, Y] += (depression - depression_for(gains.stiffness, force))[support]
        reference.velocity[:, support, Y] += rate[support]
    return reference
