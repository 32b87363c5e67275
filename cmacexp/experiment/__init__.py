"""One run: from its config to its folder, and the same from Python."""

from cmacexp.experiment.run import run_scenario

__all__ = ["run_scenario"]
