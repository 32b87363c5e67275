"""The closed loop: plan x sensors x controller x plant, at the sampling period."""

from cmacexp.loop.run import End, Samples, stream

__all__ = ["End", "Samples", "stream"]
