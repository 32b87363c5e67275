"""Runs as they are drawn, made up."""

import numpy as np

from cmacexp.recording.run_view import LegView, RunView
from cmacexp.recording.window import Window

HIPS = ((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1))
STEPS = 20


def make_walk(number=1, error=0.0, force=10.0) -> RunView:
    """One cycle of a level machine whose legs stand straight down, 0.5 m, and lift by 0.1 m in steps 6 to 9."""
    step = np.arange(STEPS)
    zero, lift = np.zeros(STEPS), np.where((step >= 6) & (step < 10), 0.1, 0.0)
    columns = {"x": zero + error, "y": 0.5 - lift, "x_desired": zero, "y_desired": 0.5 - lift}
    columns |= {"q1": zero + np.pi / 2.0, "q2": zero, "force": np.where(lift > 0.0, 0.0, force)}
    columns |= dict.fromkeys(("force_desired", "force_measured"), columns["force"])
    columns |= {f"tau_{source}_{joint}": zero for source in ("feedback", "feedforward") for joint in (1, 2)}
    legs = [
        LegView(index, f"leg {index}", dict(columns), lift == 0.0, (0.25, 0.25), hip)
        for index, hip in enumerate(HIPS, start=1)
    ]
    body = {"height": zero + 0.5, "margin_front": np.linspace(0.2, 0.1, STEPS)}
    body |= dict.fromkeys(("cog_x", "cog_y", "yaw", "pitch", "roll", "stability_margin", "margin_rear"), zero)
    config = {"terrain": {"stiffness": 1e4}, "gait": {"cycle_time": 0.1 * STEPS}, "sampling_period": 0.1}
    manifest = {"config": config, "steps": number * STEPS}
    return RunView(
        legs, 0.1 * step, step, np.full(STEPS, number), body, manifest, Window(number, number, 1, STEPS), "made", ""
    )
