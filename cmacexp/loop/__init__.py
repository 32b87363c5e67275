"""The closed loop: plan x sensors x controller x plant, at the sampling period."""

from cmacexp.loop.run import End, Rollout, Samples, roll_out, stream

__all__ = ["End", "Rollout", "Samples", "roll_out", "stream"]
