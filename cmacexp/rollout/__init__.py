"""The closed loop: plan x sensors x controller x plant, at the sampling period."""

from cmacexp.rollout.rollout import Rollout, roll_out

__all__ = ["Rollout", "roll_out"]
