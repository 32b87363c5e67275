"""The closed loop: a scenario, and the run of it, cycle by cycle."""

from cmacexp.loop.run import run_cycles

__all__ = ["run_cycles"]
