"""What a planned walk of a robot needs, and what the robot has: torque, and stiffness against rolling over."""

from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.machine import read_model
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.machine import planned_torques
from cmacexp.planning.plan import Plan
from cmacexp.planning.stability import STABILITY
from cmacexp.typing import Array

JOINT_NAMES = ("hip", "thigh", "calf")
LEAST_ROLL_STIFFNESS = 1.8
"""Roll stiffness of the feet over that with which gravity tips the body over, below which a warning is given: a
robot of 12 kg fell with 1.5, also with feedback only, and walked with 2.1 and more."""


class Walk(NamedTuple):
    """Needs of a planned walk of a robot."""

    torque: Array
    """(3,): largest planned torque of hip, thigh and calf, N m."""
    share: Array
    """(3,): that torque over the largest one of the joint; 0 without a limit."""
    widths: Array
    """(2,): distance between the feet in front and in the rear, m."""
    margin: float
    """Least planned stability margin, m; NaN if there are fewer than three feet down at times."""
    roll_stiffness: float
    """Stiffness of four feet against rolling, over that with which gravity tips the body over; NaN on drives."""

    def list_warnings(self) -> list[str]:
        """List why the robot may fall."""
        warnings = []
        if self.roll_stiffness < LEAST_ROLL_STIFFNESS:
            warnings.append(
                f"roll stiffness on four feet is {self.roll_stiffness:.3g} of that with which the body tips over, "
                f"below {LEAST_ROLL_STIFFNESS:g}: it may fall to its side; use a larger gait.width or posture.gain"
            )
        if weak := [name for name, over in zip(JOINT_NAMES, self.share, strict=True) if over > 1.0]:
            verb = "needs" if len(weak) == 1 else "need"
            warnings.append(f"{' and '.join(weak)} {verb} more torque than the model has: it may fall")
        return warnings


def judge_walk(config: Config, mechanism: Mechanism, plan: Plan) -> Walk:
    """Compute what the planned walk of the robot of a config needs."""
    force = plan.force_desired
    torque = np.abs(planned_torques(config.nominal, mechanism, plan.joints, plan.sway, force, force)).max(axis=(0, 1))
    roll_stiffness = np.nan
    if config.gains is not None and config.gains[0]:
        foot = config.gains[0] * (1.0 + config.posture.gain)
        foot *= config.terrain.stiffness / (foot + config.terrain.stiffness)  # in series
        tipping = mechanism.weight * mechanism.hip_height
        roll_stiffness = foot * float((mechanism.hips[:, 1] ** 2).sum()) / tipping
    return Walk(
        torque=torque,
        share=torque / read_model(config.machine).torque_limits,
        widths=np.abs(np.diff(mechanism.hips[:, 1].reshape(2, 2))[:, 0]),
        margin=float(plan.margins[:, STABILITY].min()),
        roll_stiffness=roll_stiffness,
    )
