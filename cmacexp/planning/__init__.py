"""Where the feet should be, when, and with which force: all that is known before a run."""

from cmacexp.planning.plan import Plan, make_plan
from cmacexp.planning.setup import Setup

__all__ = ["Plan", "Setup", "make_plan"]
