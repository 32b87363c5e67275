"""Estimation of a payload and a ground slope from foot forces and positions over a cycle.

Over a cycle of steady walking the momentum does not change, so the mean foot forces balance the weight, and their
mean moments give the position of the centre of gravity. The ground is the least-squares plane through the loaded
feet.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.config.schema import ADAPTIVE, Config
from cmacexp.jit.compiler import kernel
from cmacexp.models.mechanism import Mechanism, has_body
from cmacexp.planning.plan import LoadEstimate, Plan
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import Array, Clock, Mask

STEPS, FORCE, LONGITUDINAL, LATERAL = range(4)
"""Indices of sums over a cycle: steps; foot forces, N, and their moments about the body centre, N m."""
FEET = 4
"""First index of the sums over loaded feet: their number; x, y, xx, xy, yy of their positions; depth, x depth,
y depth of the ground below the body centre; m, m^2."""
SUMS = 13
"""Number of sums."""
LEAST_SPREAD = 1e-6
"""Square root of the determinant of the covariance of foot positions below which feet span no plane, m^2."""


class LoadMeter(NamedTuple):
    """Sums over the current cycle."""

    mechanism: Mechanism
    stiffness: float
    """Nominal ground stiffness K_n, N/m."""
    sums: Clock
    """(13,): sums in the order and units of STEPS to FEET."""


def new_load_meter(config: Config, mechanism: Mechanism) -> LoadMeter | None:
    """Make an empty load meter; return None if the plan does not adapt to the load."""
    adapts = has_body(mechanism) and config.force_control.load_sharing == ADAPTIVE
    return LoadMeter(mechanism, config.assumed_stiffness, np.zeros(SUMS)) if adapts else None


@kernel
def accumulate_load(meter: LoadMeter | None, support: Mask, observation: Observation) -> None:
    """Add the forces and positions of the feet in one step to the sums of ``meter``; do nothing if it is None.

    ``support`` (L,) is True for feet planned in support.
    """
    if meter is None:
        return
    sums = meter.sums
    hips = meter.mechanism.hips
    pitch = observation.body[1]
    roll = observation.body[2]
    sums[STEPS] += 1.0
    for i in range(support.shape[0]):
        force = observation.force[i]
        foot = observation.foot[i]
        x, y = hips[i, 0] + foot[0] - pitch * foot[1], hips[i, 1] + roll * foot[1]
        if len(meter.mechanism.axes) > 2:
            y += foot[2]
        sums[FORCE] += force
        sums[LONGITUDINAL] += force * x
        sums[LATERAL] += force * y
        if support[i] and force > 0.0:
            depth = foot[1] - force / meter.stiffness + pitch * x - roll * y
            for n, value in enumerate((1.0, x, y, x * x, x * y, y * y, depth, x * depth, y * depth)):
                sums[FEET + n] += value


def _find_slopes(sums: Array) -> tuple[float, float]:
    """Return forward and leftward slope of the least-squares plane through the feet, m/m; 0 if they span no plane."""
    x, y, xx, xy, yy, depth, x_depth, y_depth = sums[FEET + 1 :] / max(1.0, sums[FEET])
    xx, xy, yy = xx - x * x, xy - x * y, yy - y * y
    longitudinal, lateral = x_depth - x * depth, y_depth - y * depth
    determinant = xx * yy - xy * xy
    if determinant < LEAST_SPREAD**2:
        return 0.0, 0.0
    return (
        float((xy * lateral - yy * longitudinal) / determinant),
        float((xy * longitudinal - xx * lateral) / determinant),
    )


def read_meter(meter: LoadMeter, plan: Plan) -> LoadEstimate:
    """Return the load of the cycle that has ended in excess of that of the ``plan``; reset the sums."""
    sums = meter.sums.copy()
    meter.sums[...] = 0.0
    force = max(sums[FORCE] / sums[STEPS], 1e-300)
    x, y = sums[[LONGITUDINAL, LATERAL]] / (sums[STEPS] * force) - plan.load.mean_centre
    return LoadEstimate(float(force - plan.load.force.mean()), float(x), float(y), *_find_slopes(sums))
