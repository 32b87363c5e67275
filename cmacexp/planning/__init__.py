"""The plan: desired motion and force of the feet over a cycle, and all other data that are known before a run."""

from cmacexp.planning.plan import Plan, Recall, Setup, make_plan
from cmacexp.planning.reference import ControlReference, Motion

__all__ = ["ControlReference", "Motion", "Plan", "Recall", "Setup", "make_plan"]
