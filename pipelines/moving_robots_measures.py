"""Course and speed of robots that move."""

import numpy as np

from cmacexp.data.run import Run
from cmacexp.data.tables import BODY_FILE
from pipelines.common_results import if_completed


@if_completed
def off_course(run: Run) -> float:
    """Relative error of the body's way in the last cycle."""
    gait, body = run.config["gait"], run.cycles([run.config["cycles"]], BODY_FILE)
    speed = gait["stroke"] / (gait["duty_factor"] * gait["cycle_time"])
    planned = speed * run.config["sampling_period"] * (len(body) - 1)
    return float(abs((body["cog_x"].iloc[-1] - body["cog_x"].iloc[0]) / planned - 1.0))


@if_completed
def drift(run: Run) -> float:
    """Largest distance of the body from its course in the last cycle, m."""
    return float(np.abs(run.cycles([run.config["cycles"]], BODY_FILE)["cog_y"]).max())
