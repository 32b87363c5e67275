"""The closed loop: scenarios, and runs cycle by cycle."""

from cmacexp.loop.run import run_cycles

__all__ = ["run_cycles"]
