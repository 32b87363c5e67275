"""One run: from its config to its folder, and the same from Python."""

from cmacexp.experiment.run import clear, run_scenario

__all__ = ["clear", "run_scenario"]
