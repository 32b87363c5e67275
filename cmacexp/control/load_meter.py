"""What the feet carried and where they stood over a cycle: a load and a slope that the plan does not know.

Over a cycle of steady walking momentum does not change, so that the mean forces of the feet balance the weight, and
their mean moments its lever arms. A plane through the feet that pressed is the ground.
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
"""Sums over a cycle: steps; forces of the feet and their moments about the body's centre, N and N m."""
FEET = 4
"""First of the sums over the feet that pressed: their number; x, y, xx, xy, yy of their places; depth, x depth,
y depth of the ground below the body's centre; m, m^2."""
SUMS = 13
LEAST_SPREAD = 1e-6
"""Variance of the places of the feet below which they span no plane, m^2."""


class LoadMeter(NamedTuple):
    """Sums over the present cycle."""

    mechanism: Mechanism
    stiffness: float
    """K_n that the controller assumes, N/m."""
    sums: Clock
    """(13,): in the order and units of STEPS to FEET."""


def new_load_meter(config: Config, mechanism: Mechanism) -> LoadMeter | None:
    """A meter at the start of a cycle; None where the plan does not adapt to the load."""
    adapts = has_body(mechanism) and config.force_control.load_sharing == ADAPTIVE
    return LoadMeter(mechanism, config.assumed_stiffness, np.zeros(SUMS)) if adapts else None


@kernel
def accumulate_load(meter: LoadMeter | None, support: Mask, observation: Observation) -> None:
    """Note the forces and places of the feet in a step; ``support`` (L,) are those planned to press."""
    if meter is None:
        return
    sums = meter.sums
    hips = meter.mechanism.hips
    pitch = observation.body[1]
    roll = observation.body[2]
    sums[STEPS] += 1.0
    for i in range(support.shape[0]):
        force, foot = observation.force[i], observation.foot[i]
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
    """Slopes of the least-squares plane through the feet, forward and to the left, m/m; 0 where they span none."""
    x, y, xx, xy, yy, depth, x_depth, y_depth = sums[FEET + 1 :] / max(1.0, sums[FEET])
    xx, xy, yy = xx - x * x, xy - x * y, yy - y * y
    longitudinal, lateral = x_depth - x * depth, y_depth - y * depth
    size = xx * yy - xy * xy
    if size < LEAST_SPREAD**2:
        return 0.0, 0.0
    return float((xy * lateral - yy * longitudinal) / size), float((xy * longitudinal - xx * lateral) / size)


def read_meter(meter: LoadMeter, plan: Plan) -> LoadEstimate:
    """What was met in the cycle that has ended, beyond the load of the ``plan``; a new cycle begins."""
    sums, steps = meter.sums.copy(), meter.sums[STEPS]
    meter.sums[...] = 0.0
    planned, force = plan.load.force.mean(), max(sums[FORCE] / steps, 1e-300)
    x, y = sums[[LONGITUDINAL, LATERAL]] / (steps * force) - plan.load.mean_centre
    return LoadEstimate(float(force - planned), float(x), float(y), *_find_slopes(sums))
