"""A plant that is not simulated: it comes to rest at the end, before anything is written."""

import pandas as pd
import pytest

import cmacexp
from cmacexp.plants import AnalyticPlant


class LivePlant:
    """The project's own machine, as one that is not simulated; it breaks in step ``breaks``."""

    def __init__(self, breaks=-1):
        self.inner, self.breaks, self.ends, self.threads = (
            AnalyticPlant(AnalyticPlant.Config(substeps=1)),
            breaks,
            [],
            [],
        )

    def reset(self, setup):
        self.steps = 0
        return self.inner.reset(setup)

    def step(self, torque):
        self.steps += 1
        if self.steps == self.breaks:
            raise RuntimeError("a cable")
        return self.inner.step(torque)

    def end_run(self, is_safe):
        self.ends.append(is_safe)

    def describe(self):
        return {"steps": self.steps}


def run(tmp_path, plant, name, cycles=2, *more):
    return cmacexp.run(["scenario=one_leg", f"cycles={cycles}", "record=trace", *more], tmp_path / name, plant=plant)


@pytest.mark.ci
@pytest.mark.parametrize(("breaks", "status", "steps"), [(-1, "completed", 1200), (700, "failed", 700)])
def test_it_comes_to_rest_however_a_run_ends(tmp_path, breaks, status, steps):
    plant = LivePlant(breaks)
    done = run(tmp_path, plant, "live")
    assert (done.status, plant.ends, done.manifest["plant"]) == (status, [status == "completed"], {"steps": steps})
    same = run(tmp_path, AnalyticPlant(AnalyticPlant.Config(substeps=1)), "simulated")
    pd.testing.assert_frame_equal(done.trace, same.trace[: len(done.trace)])


@pytest.mark.ci
def test_it_is_never_kept_waiting_for_samples_and_loses_none(tmp_path):
    """70 cycles of 200 samples: more than a simulated plant's run keeps in memory."""
    short = [70, "sampling_period=0.015", "learning=lasting"]
    live = run(tmp_path, LivePlant(), "live", *short)
    simulated = run(tmp_path, AnalyticPlant(AnalyticPlant.Config(substeps=1)), "simulated", *short)
    pd.testing.assert_frame_equal(live.trace, simulated.trace)
    memory = [pd.read_parquet(each.folder / "memory.parquet") for each in (live, simulated)]
    assert len(memory[0]) == 70
    pd.testing.assert_frame_equal(*memory)
