"""``sys.exit()`` in a component, or an interrupt while results are written: nothing else ends, no result is lost."""

import pytest
from support.command import python, sweep

import cmacexp

COMPONENTS = """
import sys
from dataclasses import dataclass
import numpy as np
from cmacexp.config import ComponentConfig
from cmacexp.control import HybridController
from cmacexp.plants import AnalyticPlant
from cmacexp.sensors import PerfectSensors

class Feedforward:
    acts = True
    def reset(self, setup): self.shape = setup.mechanism.shape
    def predict(self, reference, learning_error): return np.zeros(self.shape)
    def learnt(self): return {}

class Made(Feedforward):
    def __init__(self): sys.exit(3)

class Reset(Feedforward):
    def reset(self, setup): sys.exit("no licence")

class Predict(Feedforward):
    def predict(self, reference, learning_error): sys.exit()

class Learnt(Feedforward):
    def learnt(self): raise SystemExit(0)

class Act(HybridController):
    def act(self, reference, measurement): sys.exit(0)

class Measure(PerfectSensors):
    def measure(self, true): sys.exit(0)

class Step(AnalyticPlant):
    def step(self, torque): sys.exit(0)

class Checks(Feedforward):
    @dataclass
    class Config(ComponentConfig):
        def check(self, config): sys.exit(0)
    def __init__(self, config): pass
"""
BASE = ("scenario=force_step", "gait.cycle_time=0.3", "sampling_period=0.01", "cycles=2", "warn=false")
PLACES = {
    "Reset": ("feedforward", "Reset.reset raised SystemExit('no licence')", 0),
    "Act": ("controller", "Act.act raised SystemExit(0)", 0),
    "Measure": ("sensors", "Measure.measure raised SystemExit(0)", 0),
    "Step": ("plant", "Step.step raised SystemExit(0)", 0),
    "Predict": ("feedforward", "Predict.predict raised SystemExit(None)", 30),
    "Learnt": ("feedforward", "Learnt.learnt raised SystemExit(0)", 60),
}


def overrides(here, part, group="feedforward"):
    weights = ["record.weights=true"] if group == "feedforward" else ["feedforward=none"]
    return [*BASE, *weights, f"{group}._target_={here}.{part}"]


@pytest.mark.parametrize("part", PLACES)
def test_the_run_fails_and_says_where(here, part):
    group, reason, steps = PLACES[part]
    run = cmacexp.run(overrides(here, part, group), "out")
    assert (run.outcome.status, run.manifest["steps"]) == ("failed", steps)
    assert f"{reason} ({here}.py, line " in run.manifest["cause"]
    first, shown, *_ = run.manifest["traceback"].splitlines()
    assert first.startswith("Traceback")
    assert f"{here}.py" in shown, "the first frame is the user's"


@pytest.mark.ci
def test_no_job_of_a_sweep_and_no_run_in_memory_is_lost(here, tmp_path):
    names = ("Predict", "Made", "Checks", "Feedforward")
    parts = ",".join(f"{here}.{part}" for part in names)
    done = sweep(*BASE, f"feedforward._target_={parts}", folder=tmp_path)
    assert done.returncode == 1
    assert "4 jobs: 3 failed, 1 completed" in done.stdout
    causes = [cmacexp.load(tmp_path / "s" / str(number)).manifest["cause"] for number in range(4)]
    for cause, text in zip(causes, ("Predict.predict", "Made.__init__", "Config.check"), strict=False):
        assert f"{text} raised SystemExit" in cause
    runs = [[*BASE, f"feedforward._target_={here}.{part}"] for part in ("Feedforward", "Predict")]
    table = cmacexp.run_many(runs, processes=1)
    assert table.groupby("run")["status"].first().tolist() == ["completed", "failed"]


@pytest.mark.ci
def test_a_signal_handler_of_the_program_ends_it(here, tmp_path):
    """A program that ends by ``sys.exit`` at SIGTERM still does while it runs a component."""
    (tmp_path / "program.py").write_text(f"""
import os, signal, sys
import cmacexp
from {here} import Feedforward

class Signals(Feedforward):
    def predict(self, reference, learning_error):
        os.kill(os.getpid(), signal.SIGTERM)
        return super().predict(reference, learning_error)

signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(77))
cmacexp.run({list(BASE)}, "out", feedforward=Signals())
print("still here")
""")
    done = python("program.py", folder=tmp_path)
    assert (done.returncode, done.stdout) == (77, "")
