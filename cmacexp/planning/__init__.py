"""Where the feet should be, when, and with which force: all that is known before a run."""

from cmacexp.planning.plan import Plan, make_plan

__all__ = ["Plan", "make_plan"]
