"""Custom components: how they are found and made, what they are held to, what is reported when they are wrong."""

import numpy as np
import pytest
from support.command import call
from support.controllers import CONTROLLERS
from support.doors import BadInput, compose_config, make_scenario, roll_out
from support.manifests import change_manifest

import cmacexp
from cmacexp.control import Action, HybridController
from cmacexp.errors import format_user_traceback
from cmacexp.feedforward import CmacFeedforward
from cmacexp.plants import AnalyticPlant
from cmacexp.sensors import PerfectSensors

PARTS = {
    "plant": AnalyticPlant,
    "sensors": PerfectSensors,
    "controller": HybridController,
    "feedforward": CmacFeedforward,
}
GAINS = HybridController.Config(100.0, 5.0, 5.0, 10.0)
SHORT = ("scenario=one_leg", "cycles=2", "gait.cycle_time=0.5", "gait.stroke=0.02", "record=trace")
STEPS = 100
"""Of a cycle."""
COMPONENTS = f"""{CONTROLLERS}
class Stiff(Still):
    def __init__(self, position_gain, velocity_gain): super().__init__()

class Breaks(Still):
    def act(self, reference, measurement):
        gain = 1 / (reference.step - 120)
        return super().act(reference, measurement)

class BreaksAtOnce(Still):
    def reset(self, setup, feedforward): raise KeyError("no such leg")

calls = []

def function(**fields): calls.append("function")

class NoMethods:
    def __init__(self, **fields): calls.append("NoMethods")

class NoArguments(NoMethods):
    def reset(self): pass
    def act(self): pass
"""


# How they are found and made


def test_a_class_in_the_current_folder_gets_the_fields_it_takes(here):
    """A field that names a class is data: nothing that a field holds is called."""
    other = make_scenario(compose_config([f"controller._target_={here}.Still", "+controller.gain._target_=os.abort"]))
    assert other.controller.gain == {"_target_": "os.abort"}


def test_what_is_no_component_is_not_called(here):
    for target in ("function", "NoMethods", "NoArguments"):
        with pytest.raises(BadInput, match="controller"):
            make_scenario(compose_config([f"controller._target_={here}.{target}"]))
    assert __import__(here).calls == []


def test_readers_of_a_run_do_not_import_what_its_manifest_names(here, tmp_path):
    run = cmacexp.run(SHORT, tmp_path / "run")
    planted = {group: {**run.config[group], "_target_": f"{here}_planted.Part"} for group in PARTS}
    change_manifest(run.folder, config=run.config | planted)
    (tmp_path / f"{here}_planted.py").write_text("open('ran', 'w').close()")
    assert len(cmacexp.load(run.folder).trace) == 2 * STEPS
    assert [call(reader, run.folder).returncode for reader in ("verify", "score", "stability")] == [0, 0, 2]
    with pytest.raises(BadInput, match="add trust=True if you trust it"):
        cmacexp.run(cmacexp.load(run.folder).config, tmp_path / "again")
    assert not (tmp_path / "ran").exists()
    with pytest.raises(BadInput, match="has no Part"):
        cmacexp.run(cmacexp.load(run.folder).config, tmp_path / "again", trust=True)
    assert (tmp_path / "ran").exists()


def test_a_run_with_a_component_of_ones_own_is_run_again_from_its_config(here, tmp_path):
    first = cmacexp.run([*SHORT, f"controller._target_={here}.Still", "+controller.gain=0.5"], tmp_path / "run")
    again = cmacexp.run(first.config, tmp_path / "again", trust=True)
    assert again.manifest["files"] == first.manifest["files"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:", "SyntaxError"),
        ("x = unknown", "NameError: name 'unknown'"),
        ("import no_such", "no module named no_such"),
        (f"{CONTROLLERS}\nC = CannotBeMade", "ValueError: no licence"),
    ],
)
def test_what_a_file_raises_is_reported_with_its_traceback(here, tmp_path, text, message):
    (tmp_path / f"{here}_bad.py").write_text(text)
    with pytest.raises(BadInput, match=message) as caught:
        make_scenario(compose_config([f"controller._target_={here}_bad.C"]))
    shown = format_user_traceback(caught.value.raised)
    assert f"{here}_bad.py" in shown
    assert "hydra" not in shown


# What they are given, and what they give back


class Spy:
    """A controller that keeps all that it is given, and spoils it."""

    def reset(self, setup, feedforward):
        setup.plan.reference.position[:] = np.nan
        setup.mechanism.legs[:] = 0.0
        self.kept, self.copies = [], []

    def act(self, reference, measurement):
        self.kept.append(measurement)
        self.copies.append(measurement.q.copy())
        with pytest.raises(ValueError, match="read-only"):
            reference.control.position[:] = 0.0
        measurement.force[:] = 1e6
        return Action(np.full((1, 2), 0.1), np.zeros((1, 2)))


def test_a_part_can_keep_what_it_is_given_and_harm_nobody_by_it(make_config):
    spy = Spy()
    spoiled = roll_out(make_scenario(make_config(*SHORT), controller=spy))
    assert all(np.array_equal(kept.q, copy) for kept, copy in zip(spy.kept, spy.copies, strict=True))
    assert len({copy.tobytes() for copy in spy.copies}) > 50
    assert spoiled.columns()["force"].max() < 1e5


ANSWERS = {
    "None": lambda a: None,
    "array": lambda a: a.feedback,
    "flat": lambda a: a._replace(feedback=np.zeros(2)),
    "text": lambda a: a._replace(feedforward="much"),
    "ragged": lambda a: a._replace(feedback=[[1.0], [1.0, 2.0]]),
    "complex": lambda a: a._replace(feedback=np.zeros((1, 2), complex)),
    "NaN": lambda a: a._replace(feedback=np.array([[0.0, np.nan]])),
}


class Answers(HybridController):
    """Gives something else at one step."""

    def __init__(self, change, step):
        super().__init__(GAINS)
        self.change, self.step = change, step

    def act(self, reference, measurement):
        action = super().act(reference, measurement)
        return self.change(action) if reference.step == self.step else action


@pytest.mark.parametrize("case", ANSWERS)
def test_an_answer_that_cannot_be_used_fails_the_run_and_keeps_the_steps_before(make_config, case):
    for step in (0, 120):
        rollout = roll_out(make_scenario(make_config(*SHORT), controller=Answers(ANSWERS[case], step)))
        assert (rollout.status, len(rollout.samples)) == ("failed", step)
        assert rollout.cause.startswith(f"after step {step}: Answers.act returned ")


@pytest.mark.parametrize(
    ("key", "method"), [("plant", "step"), ("sensors", "measure"), ("plant", "reset"), ("feedforward", "predict")]
)
def test_every_part_is_held_to_its_shapes(make_config, key, method):
    def odd(self, *arguments):
        given = getattr(PARTS[key], method)(self, *arguments)
        return np.zeros((2, 2)) if key == "feedforward" else given._replace(q=np.zeros((2, 2)))

    config = make_config(*SHORT, "learning.start_cycle=1")
    part = type("Odd", (PARTS[key],), {method: odd})(getattr(config, key))
    rollout = roll_out(make_scenario(config, **{key: part}))
    assert (rollout.status, len(rollout.samples)) == ("failed", 0)
    assert f"Odd.{method} returned " in rollout.cause


# What is left of a run whose component fails


@pytest.mark.parametrize(
    ("name", "steps", "message"),
    [("Breaks", 120, "ZeroDivisionError"), ("Flat", 0, "shape (2,)"), ("BreaksAtOnce", 0, "no such leg")],
)
def test_a_run_that_fails_keeps_its_steps_its_cause_and_the_traceback(here, tmp_path, name, steps, message):
    done = call("main", *SHORT, f"controller._target_={here}.{name}", "hydra.run.dir=r", folder=tmp_path)
    run = cmacexp.load(tmp_path / "r")
    assert (done.returncode, run.status, run.manifest["steps"]) == (1, "failed", steps)
    assert message in done.stderr.splitlines()[-1]
    assert bool(run.manifest["traceback"]) == (name != "Flat"), "an answer of a wrong shape raises nothing"
    assert ("gain = 1 / (reference.step - 120)" in done.stderr) == (name == "Breaks")
    assert (len(run.trace) if steps else 0) == steps


class Talks(AnalyticPlant):
    def describe(self):
        return {"volts": np.float32(31.0)}


class Ends(AnalyticPlant):
    def end_run(self, is_safe):
        raise RuntimeError("a motor is lost")


class Lists(AnalyticPlant):
    def list_steps(self, start, stop):
        return {"answer_time": 0.001}


@pytest.mark.ci  # a plant that is not simulated has its loop compiled
@pytest.mark.parametrize(
    ("plant", "reason"),
    [(Talks, "not JSON serializable"), (Ends, "a motor is lost"), (Lists, "KeyError: 'states_missed'")],
)
def test_a_plant_that_fails_after_the_last_step_fails_the_run_which_keeps_its_trace(tmp_path, plant, reason):
    run = cmacexp.run(SHORT, tmp_path / "run", plant=plant(compose_config(SHORT).plant))
    assert (run.status, len(run.trace)) == ("failed", 2 * STEPS)
    assert reason in run.manifest["cause"]
    assert reason in run.manifest["traceback"]


@pytest.mark.parametrize(
    ("members", "reason"),
    [
        ({"feedback_delay": lambda self, uses_velocity: -1}, "declares -1"),
        ({"feedback_delay": lambda self, uses_velocity: 1.5}, "declares 1.5"),
        ({"feedback_lag": lambda self, uses_velocity: np.nan}, "declares nan"),
        ({"alters": ("forces",)}, "sensors.alters=forces: choose from"),
    ],
)
def test_what_sensors_declare_is_checked(tmp_path, members, reason):
    sensors = type("Declares", (PerfectSensors,), members)(compose_config(SHORT).sensors)
    with pytest.raises(BadInput, match=reason):
        cmacexp.run(SHORT, tmp_path / "run", sensors=sensors)


# From Python


@pytest.mark.parametrize("overrides", [None, 5, [5], [None], ["hydra.sweep.dir=x"]])
def test_what_is_no_list_of_overrides_is_refused(overrides):
    for refuses in (cmacexp.run, cmacexp.open_loop, lambda given: cmacexp.run_many([given])):
        with pytest.raises(BadInput, match="overrides"):
            refuses(overrides)


def test_overrides_may_come_one_by_one():
    assert cmacexp.open_loop(text for text in SHORT[:3]).steps == 2 * STEPS
    assert set(cmacexp.run_many([(text for text in SHORT[:4])], processes=1)["cycles"]) == {2}


def test_a_run_goes_below_outputs_and_is_loaded_again(here):
    run = cmacexp.run(SHORT)
    assert run.folder.parent.as_posix() == "outputs/one_leg"
    assert (run.status, len(run.trace), len(run.metrics)) == ("completed", 2 * STEPS, 2)
    loaded = cmacexp.load(run.folder)
    again = cmacexp.run(loaded.config, "again")
    assert loaded.trace.equals(run.trace)
    assert again.trace.equals(run.trace)
    assert (run.manifest["overrides"], again.manifest["overrides"]) == ([*SHORT], None)
    assert run.trace.attrs["units"]["force"] == run.units["force"] == "N"
    assert (repr(loaded), loaded.manifest) == (repr(run), run.manifest)
    assert str(run).startswith(f"{run!r}\n")
    assert run._repr_html_().count("<tr") == 3
    with pytest.raises(BadInput, match="did you mean force_rmse"):
        run.final("force_rsme")
