"""``sys.exit()`` in a component: its run fails, wherever it runs, and nothing else ends."""

import sys

import pytest
from support.command import cmacexp, python

import cmacexp as package
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadComponent, ComponentExit
from cmacexp.experiment.batch import run_many
from cmacexp.experiment.collect import collect
from cmacexp.experiment.workers import workers
from cmacexp.jit.interrupt import exits_caught
from cmacexp.study import Request

PARTS = """
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


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, with the components in a module that no other test has imported."""
    name = f"exits_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(PARTS)
    monkeypatch.chdir(tmp_path)
    return name


def overrides(here, part, group="feedforward"):
    weights = ["record.weights=true"] if group == "feedforward" else ["feedforward=none"]
    return [*BASE, *weights, f"{group}._target_={here}.{part}"]


@pytest.mark.parametrize("part", PLACES)
def test_the_run_fails_and_says_where(here, part, tmp_path):
    group, reason, steps = PLACES[part]
    run = package.run(overrides(here, part, group), tmp_path / "out")
    assert (run.status, run.manifest["steps"]) == ("failed", steps)
    assert f"{reason} ({here}.py, line " in run.manifest["cause"]
    first, shown, *_ = run.manifest["traceback"].splitlines()
    assert first.startswith("Traceback")
    assert f"{here}.py" in shown, "the first frame is the user's"


def test_a_component_that_cannot_be_made_is_refused(here):
    with pytest.raises(BadComponent, match=r"cannot be made: ComponentExit: Made.__init__ raised SystemExit\(3\)"):
        package.run(overrides(here, "Made"))
    with pytest.raises(ComponentExit, match=r"Config\.check raised SystemExit"):
        package.run(overrides(here, "Checks"))


def test_a_command_ends_with_1(here, tmp_path):
    done = cmacexp(*overrides(here, "Act", "controller"), "hydra.run.dir=out", folder=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("error: after step 0: ComponentExit: Act.act raised SystemExit(0)")
    assert StoredRun(tmp_path / "out").status == "failed"


def test_no_job_of_a_sweep_is_lost(here, tmp_path):
    parts = ",".join(f"{here}.{part}" for part in ("Predict", "Made", "Checks", "Feedforward"))
    words = ["-m", *BASE, f"feedforward._target_={parts}", "hydra.sweep.dir=out"]
    done = cmacexp(*words, folder=tmp_path)
    assert done.returncode == 1
    assert "4 jobs: 3 failed, 1 completed" in done.stdout
    causes = [StoredRun(tmp_path / "out" / str(number)).manifest["cause"] for number in range(4)]
    for cause, text in zip(causes, ("Predict.predict", "Made.__init__", "Config.check"), strict=False):
        assert f"{text} raised SystemExit" in cause


def test_runs_in_memory_and_of_studies_fail_too(here, tmp_path):
    good, bad = overrides(here, "Feedforward")[:-1], overrides(here, "Predict")
    good[-1] = "feedforward=none"
    statuses = run_many([good, bad], processes=1).groupby("run")["status"].first()
    assert statuses.tolist() == ["completed", "failed"]
    requests = [Request(tuple(each)) for each in (good, bad)]
    with workers(processes=1) as each:
        found = collect(each, requests, tmp_path / "runs")
    assert [StoredRun(found[request][0]).status for request in requests] == ["completed", "failed"]


def test_a_measure_of_a_study_that_exits_is_an_error_of_the_study(tmp_path):
    (tmp_path / "my_study.md").write_text("# Exits\n")
    (tmp_path / "my_study.py").write_text(f"""
import sys
from cmacexp.study import Request, Study

def measure(run):
    sys.exit(0)

RUN = Request({(*BASE, "feedforward=none")})
STUDY = Study(title="Exits", question="Does it?", runs=lambda quick: [RUN], measures={{"own": measure}})
""")
    done = python("-m", "cmacexp.study", "my_study.py", "--seeds", "1", folder=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "measure raised SystemExit(0) (my_study.py, line 6)" in done.stderr


def test_a_method_of_the_benchmark_that_exits_has_failed(here):
    from pipelines.benchmark.trial import run_stage

    stages = [run_stage(overrides(here, part)) for part in ("Predict", "Learnt", "Feedforward")]
    assert [stage.status for stage in stages] == ["failed", "failed", "completed"]
    assert "Learnt.learnt raised SystemExit(0)" in stages[1].cause


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


def test_what_a_library_makes_of_an_interrupt_is_that_interrupt(monkeypatch):
    monkeypatch.setattr("cmacexp.jit.interrupt._State.raised", True)
    with pytest.raises(KeyboardInterrupt), exits_caught():
        sys.exit(1)
