"""Metrics of tracking and force error per learning cycle and leg: pure functions of the trace."""

from cmacexp.metrics.body import compute_body
from cmacexp.metrics.compute import compute

__all__ = ["compute", "compute_body"]
