"""Metrics of tracking, force and learning: per cycle and leg from a trace, or of one response."""

from cmacexp.metrics.body import compute_body
from cmacexp.metrics.score import compute
from cmacexp.metrics.step import StepInfo, step_info

__all__ = ["StepInfo", "compute", "compute_body", "step_info"]
