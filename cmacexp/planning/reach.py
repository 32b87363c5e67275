"""Whether the legs can put their feet where the plan wants them."""

import numpy as np

from cmacexp.arrays import Array
from cmacexp.config import Config
from cmacexp.errors import BadInput
from cmacexp.models.mechanism import Mechanism

STRAIGHT = 1.0 - 1e-6
"""Largest extension over reach: a straight leg cannot move along itself."""
FOLDED = 1e-3
"""Least distance of the foot from where the links lie on each other, m."""


def check_reach(config: Config, mechanism: Mechanism, desired: Array) -> None:
    """Hold the desired foot path (N, L, 6) to the reach of every leg.

    Raises:
        BadInput: names stroke or hip height, whichever is to blame, and what would be in reach.
    """
    for i, leg in enumerate(mechanism.legs):
        reach = (leg[0] + leg[1]) * STRAIGHT
        nearest = abs(leg[0] - leg[1])
        x, y = desired[:, i, 0], desired[:, i, 1]
        distance = np.hypot(x, y)
        k = int(np.argmax(distance))
        if distance[k] > reach:
            where = f"the foot of leg {i + 1} would be {distance[k]:.3f} m from its hip at sample {k}"
            if abs(y[k]) >= reach:
                height = mechanism.hip_height - (abs(y[k]) - reach)
                raise BadInput(
                    "machine.hip_height",
                    mechanism.hip_height,
                    f"{where}, but the leg reaches {reach:.3f} m; must be below {height:.4g} m on this ground",
                )
            # Every x is proportional to the stroke.
            room = np.sqrt(np.maximum(reach**2 - y**2, 0.0)) / np.maximum(np.abs(x), 1e-12)
            widest = config.gait.stroke * float(room.min())
            raise BadInput(
                "gait.stroke",
                config.gait.stroke,
                f"{where}, but the leg reaches {reach:.3f} m; must be at most {widest:.4g} m",
            )
        k = int(np.argmin(distance))
        if distance[k] <= nearest + FOLDED:
            raise BadInput(
                "gait.lift",
                config.gait.lift,
                f"leg {i + 1} cannot fold that far: at sample {k} its foot would be {distance[k]:.3f} m off; "
                f"must be below {y[0] - nearest - FOLDED:.4g} m",
            )
