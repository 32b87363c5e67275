"""Is a higher learning rate better? Both rates in the same 20 randomised runs, and the interval of their ratio."""

import numpy as np
import pandas as pd

import cmacexp
from cmacexp.addons.study.interval import estimate


def draw_world(number: int) -> list[str]:
    """Draw random overrides of the plant, unknown to planner and controller; a number always gives the same ones."""
    draw = np.random.default_rng(number)
    return [
        f"seed={number}", "plant.start_spread=0.05", f"plant.start_seed={number}",
        f"terrain.stiffness={10 * np.exp(draw.uniform(-0.3, 0.3)):.4g}", "terrain.assumed_stiffness=10",
        f"plant.mass_factor={draw.uniform(0.8, 1.2):.4f}",
    ]  # fmt: skip


def compute_errors(rate: float) -> pd.Series:
    """Return the transfer error of the last cycle of each run, m; infinite where it did not complete."""
    common = ["scenario=one_leg", "reference=aware", "learning.lead=1", f"learning.rate={rate}"]
    last = cmacexp.run_many([[*common, *draw_world(number)] for number in range(20)]).groupby("run").last()
    return np.hypot(last["transfer_rmse_x"], last["transfer_rmse_y"]).where(last["status"] == "completed", np.inf)


if __name__ == "__main__":  # workers of run_many import this file
    before, after = compute_errors(0.2).to_numpy(), compute_errors(0.8).to_numpy()
    ratio = estimate(after / before)
    better = estimate(after < before)
    print(f"error with rate 0.8 over that with 0.2: {ratio.value:.3f} [{ratio.low:.3f}, {ratio.high:.3f}]")
    print(f"better in {better.value:.0%} of {better.count} worlds [{better.low:.0%}, {better.high:.0%}]")
