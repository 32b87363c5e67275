"""Metrics of tracking, force and learning, per cycle and leg, from a trace."""

from cmacexp.metrics.body import compute_body
from cmacexp.metrics.score import compute

__all__ = ["compute", "compute_body"]
