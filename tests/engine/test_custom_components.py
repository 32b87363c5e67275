"""Parts of one's own: how they are found and made, what they are held to, what is told when they are wrong."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.command import cmacexp
from support.controllers import CONTROLLERS
from support.manifests import change_manifest
from support.rollout import roll_out

import cmacexp as package
from cmacexp.commands.score import score
from cmacexp.config.compose import compose_config
from cmacexp.control import Action, HybridController
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadComponent, BadInput, CmacexpError, format_user_traceback
from cmacexp.experiment.run import run_scenario
from cmacexp.feedforward import CmacFeedforward
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.report.run_tables import list_settings
from cmacexp.sensors import PerfectSensors

PARTS = {
    "plant": AnalyticPlant,
    "sensors": PerfectSensors,
    "controller": HybridController,
    "feedforward": CmacFeedforward,
}
GAINS = HybridController.Config(100.0, 5.0, 5.0, 10.0)
OWN = f"""{CONTROLLERS}
class Stiff(Still):
    def __init__(self, position_gain, velocity_gain): super().__init__()

class Breaks(Still):
    def act(self, reference, measurement):
        gain = 1 / (reference.step - 700)
        return super().act(reference, measurement)

class BreaksAtOnce(Still):
    def reset(self, setup, feedforward): raise KeyError("no such leg")

class Reports(Still):
    memory = dropped = "own"
    def manifest_entries(self): raise KeyError("own")
"""

PREDICTS = """
class Predicts(Reports):
    acts = True
    def reset(self, setup): pass
    def predict(self, reference, learning_error): return np.zeros_like(learning_error)
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, with a file of controllers in it that no other test has imported."""
    monkeypatch.chdir(tmp_path)
    name = f"own_{abs(hash(tmp_path))}"
    (tmp_path / f"{name}.py").write_text(OWN)
    return name


# Any of the parts can be external, alone or with others


class Spy:
    """A controller that keeps all that it is given, and spoils it."""

    def reset(self, setup, feedforward):
        setup.plan.reference[:] = np.nan
        setup.mechanism.legs[:] = 0.0
        self.inner, self.kept, self.copies = HybridController(GAINS), [], []

    def act(self, reference, measurement):
        self.kept.append(measurement)
        self.copies.append(measurement.q.copy())
        with pytest.raises(ValueError, match="read-only"):
            reference.values[:] = 0.0
        measurement.force[:] = 1e6
        return Action(np.full((1, 2), 0.1), np.zeros((1, 2)))


def test_a_part_can_keep_what_it_is_given_and_harm_nobody_by_it(make_config):
    config, spy = make_config("cycles=1", "gait.cycle_time=0.5", "gait.stroke=0.02"), Spy()
    spoiled = roll_out(make_scenario(config, controller=spy))
    assert all(np.array_equal(kept.q, copy) for kept, copy in zip(spy.kept, spy.copies, strict=True))
    assert len({copy.tobytes() for copy in spy.copies}) > 50
    assert spoiled.columns()["force"].max() < 1e5


# How they are found


def test_a_class_in_the_current_folder_gets_the_fields_it_takes(here):
    scenario = make_scenario(compose(f"controller._target_={here}.Still", "+controller.gain=3"))
    assert scenario.controller.gain == 3
    assert scenario.setup.config.controller == {"_target_": f"{here}.Still", "gain": 3}


def compose(*overrides):
    return compose_config(overrides)


def test_references_rest_on_gains_only_where_the_controller_takes_them(here):
    plans = [
        make_scenario(compose("scenario=one_leg", f"controller._target_={name}")).setup.plan.reference[0, 300, 0, 1]
        for name in ("cmacexp.control.HybridController", f"{here}.Stiff", f"{here}.Still")
    ]
    assert plans[0] == plans[1]
    assert plans[0] - plans[2] == pytest.approx(1.0 / 100.0 + 5.0 / 100.0 * compose().force_control.admittance)


@pytest.mark.parametrize("method", ["stiffness", "damping", "combined", "explicit"])
def test_every_force_control_method_plans_for_a_controller_without_gains(here, method):
    reference = make_scenario(
        compose(f"controller._target_={here}.Still", f"force_control={method}")
    ).setup.plan.reference
    assert not np.isinf(reference).any()


CALLED = """
calls = []

def function(**fields): calls.append("function")

class NoMethods:
    def __init__(self, **fields): calls.append("NoMethods")

class NoArguments(NoMethods):
    def reset(self): pass
    def act(self): pass

"""
NOT_CALLED = ("function", "NoMethods", "NoArguments")


@pytest.mark.parametrize("target", NOT_CALLED)
def test_what_is_no_component_is_not_called(here, tmp_path, target):
    (tmp_path / f"{here}_called.py").write_text(CALLED)
    with pytest.raises(BadInput):
        make_scenario(compose(f"controller._target_={here}_called.{target}"))
    assert __import__(f"{here}_called").calls == []


def test_a_field_that_names_a_class_is_data(here):
    """Nothing that a field of a component holds is called."""
    controller = make_scenario(compose(f"controller._target_={here}.Still", "+controller.gain._target_=os.abort"))
    assert controller.controller.gain == {"_target_": "os.abort"}


def test_readers_of_a_run_do_not_import_what_its_manifest_names(here, tmp_path):
    run = package.run(["scenario=one_leg", "cycles=1", "record=trace"], tmp_path / "run")
    planted = {group: {**run.config[group], "_target_": f"{here}_planted.Part"} for group in PARTS}
    change_manifest(run.folder, config=run.config | planted)
    (tmp_path / f"{here}_planted.py").write_text("open('ran', 'w').close()")
    assert len(package.load(run.folder).trace) == 600
    score(run.folder)
    list_settings(StoredRun(run.folder))
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("def f(:", "SyntaxError"),
        ("x = unknown", "NameError: name 'unknown'"),
        ("import no_such", "no module named no_such"),
    ],
)
def test_a_file_that_cannot_be_imported_keeps_its_traceback(here, tmp_path, text, told):
    (tmp_path / f"{here}_bad.py").write_text(text)
    with pytest.raises(BadComponent, match=told) as caught:
        make_scenario(compose(f"controller._target_={here}_bad.C"))
    shown = format_user_traceback(caught.value.raised)
    assert text in shown
    assert f"{here}_bad.py" in shown
    assert "hydra" not in shown
    assert "parts.py" not in shown


def test_a_class_that_raises_when_it_is_made_keeps_its_traceback(here):
    with pytest.raises(BadComponent, match="cannot be made: ValueError: no licence") as caught:
        make_scenario(compose(f"controller._target_={here}.CannotBeMade"))
    assert 'raise ValueError("no licence")' in format_user_traceback(caught.value.raised)


def test_a_missing_extra_is_told_with_the_command_that_installs_it(here, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    (tmp_path / f"{here}_extra.py").write_text("import mujoco")
    with pytest.raises(BadInput, match=r'needs mujoco, .*: python -m pip install -e "\.\[mujoco\]"'):
        make_scenario(compose(f"plant._target_={here}_extra.C"))


# What they give back


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


@pytest.mark.parametrize("step", [0, 500])
@pytest.mark.parametrize("case", ANSWERS)
def test_an_answer_that_cannot_be_used_fails_the_run_and_keeps_the_steps_before(make_config, case, step):
    rollout = roll_out(make_scenario(make_config("cycles=1"), controller=Answers(ANSWERS[case], step)))
    assert rollout.status == "failed"
    assert rollout.cause.startswith(f"after step {step}: Answers.act returned ")
    assert len(rollout.samples) == step


@pytest.mark.parametrize("values", [[[0.5, 0.25]], np.array([[0.5, 0.25]], np.float32), np.array([[1, 2]])])
def test_numbers_of_any_kind_are_taken(make_config, values):
    controller = Answers(lambda a: a._replace(feedback=values), 0)
    rollout = roll_out(make_scenario(make_config("cycles=1"), controller=controller))
    assert rollout.status == "completed"
    assert rollout.samples[0, 0, 12:14].tolist() == np.asarray(values, float)[0].tolist()


@pytest.mark.parametrize(
    ("key", "method"), [("plant", "step"), ("sensors", "measure"), ("plant", "reset"), ("feedforward", "predict")]
)
def test_every_part_is_held_to_its_shapes(make_config, key, method):
    def odd(self, *arguments):
        given = getattr(PARTS[key], method)(self, *arguments)
        return np.zeros((2, 2)) if key == "feedforward" else given._replace(q=np.zeros((2, 2)))

    config = make_config("cycles=1", "learning.start_cycle=1")
    part = type("Odd", (PARTS[key],), {method: odd})(getattr(config, key))
    rollout = roll_out(make_scenario(config, **{key: part}))
    assert (rollout.status, len(rollout.samples)) == ("failed", 0)
    assert f"Odd.{method} returned " in rollout.cause


def test_a_scenario_runs_once(make_config):
    scenario = make_scenario(make_config("cycles=1"))
    roll_out(scenario)
    with pytest.raises(CmacexpError, match="this scenario has run"):
        roll_out(scenario)


# From the command line


def test_a_controller_that_raises_in_the_middle_keeps_its_traceback_and_the_trace(here, tmp_path):
    target = f"controller._target_={here}.Breaks"
    done = cmacexp(target, "cycles=2", "record=trace", "hydra.run.dir=r", folder=tmp_path)
    assert done.returncode == 1
    assert "gain = 1 / (reference.step - 700)" in done.stderr
    assert "error: after step 700: ZeroDivisionError" in done.stderr
    assert "stepped.py" not in done.stderr
    manifest = json.loads((tmp_path / "r" / "manifest.json").read_text())
    assert (manifest["status"], manifest["steps"]) == ("failed", 700)
    assert pq.read_metadata(tmp_path / "r" / "trace.parquet").num_rows == 700


@pytest.mark.parametrize(
    ("name", "told"), [("Flat", "Flat.act returned feedback of shape (2,)"), ("BreaksAtOnce", "no such leg")]
)
def test_what_fails_at_once_leaves_a_manifest_that_says_so(here, tmp_path, name, told):
    done = cmacexp(f"controller._target_={here}.{name}", "cycles=1", "hydra.run.dir=r", folder=tmp_path)
    assert done.returncode == 1
    assert told in done.stderr
    manifest = json.loads((tmp_path / "r" / "manifest.json").read_text())
    assert (manifest["status"], manifest["steps"]) == ("failed", 0)
    assert ("traceback" in manifest) == (name == "BreaksAtOnce")
    assert [use["rows"] for use in manifest["memory"]] == [65536]
    assert manifest["dropped"] == []


@pytest.mark.parametrize("overrides", [[], ["feedforward._target_={here}.Predicts"]], ids=["controller", "both"])
def test_only_components_of_the_package_add_to_the_manifest(here, tmp_path, overrides):
    (tmp_path / f"{here}.py").write_text(OWN + PREDICTS)
    targets = [f"controller._target_={here}.Reports", *(override.format(here=here) for override in overrides)]
    run = run_scenario(compose(*targets, "cycles=1", "record=trace"), tmp_path / "r")
    assert (run.status, run.manifest["dropped"]) == ("completed", [])
    assert len(run.manifest["memory"]) == (0 if overrides else 1)


# From Python


def test_run_gives_what_the_command_line_gives(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = package.run(["scenario=one_leg", "cycles=2", "record=trace"])
    assert run.folder.parent.as_posix() == "outputs/one_leg"
    assert (run.status, len(run.trace), len(run.metrics)) == ("completed", 1200, 2)
    assert "one_leg, completed, 1200 steps" in repr(run)
    assert [line.split()[0] for line in repr(run).splitlines()[-2:]] == ["1", "2"]
    assert max(map(len, repr(run).splitlines()[1:])) <= 80
    assert run._repr_html_().count("<tr") == 3
    again = package.load(run.folder)
    assert repr(again) == repr(run)
    assert again.trace.equals(run.trace)


def test_run_takes_a_folder_in_its_overrides_and_own_configs(here, tmp_path):
    (tmp_path / "mine" / "controller").mkdir(parents=True)
    (tmp_path / "mine" / "controller" / "still.yaml").write_text(f"_target_: {here}.Still\ngain: 4\n")
    run = package.run(
        ["controller=still", "cycles=1", "record=trace", "hydra.run.dir=r"], config_dir=tmp_path / "mine"
    )
    assert run.folder.name == "r"
    assert run.config["controller"]["gain"] == 4
