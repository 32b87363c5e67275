"""The benchmark: its tasks are frozen, entrants that fail are rows, nothing is run twice or known too early."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from support.command import ROOT, python

from cmacexp.config.compose import compose_config
from cmacexp.data.integrity import faults
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.robot_file import package_models
from pipelines.benchmark.entrants import ALONE, choose_methods, list_methods
from pipelines.benchmark.tasks import LEG, MACHINES, STRESS, TASKS, VERSION, change_world, hash_tasks
from pipelines.benchmark.trial import COMPLETED, Trial, run_stage
from pipelines.benchmark.tuning import DEFAULT, choose_setting, draw_settings

TASKS_OF_VERSION_1 = "fe5a5ab1812333e398fc5fcc1c12e9b39d3d9a85a11295abfa91819ff2f297ff"

ENTRANTS = '''
import numpy as np

GIVEN = 0.0


class Base:
    acts = True

    def __init__(self, config=None):
        pass

    def reset(self, setup):
        self.shape = (setup.plan.support.shape[1], setup.mechanism.shape[1])
        self.believed = setup.config.terrain.stiffness

    def predict(self, reference, learning_error):
        return np.full(self.shape, GIVEN)


class Raises(Base):
    def predict(self, reference, learning_error):
        raise RuntimeError("broken")


class Undefined(Base):
    def predict(self, reference, learning_error):
        return np.full(self.shape, np.nan)


class Diverges(Base):
    def predict(self, reference, learning_error):
        return np.full(self.shape, 1e3)


class Refuses(Base):
    def reset(self, setup):
        from cmacexp.errors import BadInput

        raise BadInput("machine", setup.config.machine.kind, "is not for me")


class Spy(Base):
    """A constant that shows which stiffness it was given."""

    def predict(self, reference, learning_error):
        return np.full(self.shape, 1e-9 * self.believed)
'''


def run(folder, *words):
    done = python("-m", "pipelines.benchmark", "--quick", "--folder", str(folder / "out"), *words, folder=folder)
    return done, folder / "out" / "benchmark-quick"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmark")
    (folder / "entrants.py").write_text(ENTRANTS)
    return folder


BROKEN = ("Raises", "Undefined", "Diverges", "Refuses")


@pytest.fixture(scope="module")
def result(folder):
    entered = [word for name in BROKEN for word in ("--method", f"entrants.{name}")]
    done, place = run(folder, "--methods", "model", *entered)
    assert done.returncode == 0, done.stderr
    return place


def test_the_tasks_are_those_of_their_version():
    """Whoever changes a task, a world or a protocol raises VERSION, and writes its hash here."""
    assert (VERSION, hash_tasks(MACHINES)) == (1, TASKS_OF_VERSION_1)


def test_the_page_of_the_documentation_names_tasks_and_counts_as_they_are():
    text = (ROOT / "docs" / "benchmark.md").read_text()
    leg, robot = MACHINES[LEG], MACHINES["go1"]
    assert f"learns for {leg.before} cycles (robots {robot.before})" in text
    assert f"One leg and the quadruped have {leg.worlds} worlds, robots {robot.worlds}" in text
    assert f"gets {leg.draws} settings" in text
    assert re.findall(r"^\| `(\w+)` \|", text, flags=re.MULTILINE) == list(TASKS)
    assert f"of version {VERSION}:" in text


@pytest.mark.parametrize(
    "name", [name for name in MACHINES if MACHINES[name].scenario != "robot" or package_models()]
)
def test_feedback_alone_completes_every_task(name):
    machine, (alone, *_) = MACHINES[name], choose_methods("model", [])
    worlds = range(2 if machine.scenario != "robot" else 1)
    trial = Trial(machine, alone, DEFAULT, tuple(worlds), TASKS)
    for world in worlds:
        drawn = machine.draw(world)
        for task in TASKS if machine.scenario != "robot" else TASKS[:2]:
            changed = change_world(drawn, machine.changes[task])
            assert run_stage(trial.list_overrides(changed, "cycles=3")).status == COMPLETED


def test_worlds_of_tests_and_of_tuning_are_apart_and_the_same_for_all():
    machine = MACHINES[LEG]
    tested, tuned = ({machine.draw(n, tuning) for n in range(20)} for tuning in (False, True))
    assert len(tested) == len(tuned) == 20
    assert not tested & tuned
    assert change_world(["a=2", "b=1"], ["a=x1.5", "c=4"]) == ["a=3", "b=1", "c=4"]


def test_a_broken_entrant_is_rows_that_failed_and_changes_no_other(result, folder):
    rows = pd.read_parquet(result / "benchmark.parquet")
    failed = rows[rows["status"] != COMPLETED].groupby("method")["status"].unique()
    assert {name: list(failed[name]) for name in BROKEN} == {
        "Raises": ["failed"], "Undefined": ["failed"], "Diverges": ["diverged"], "Refuses": ["refused"],
    }  # fmt: skip
    others = rows[~rows["method"].isin(BROKEN) & (rows["task"] != STRESS)]
    assert (others["status"] == COMPLETED).all()
    assert np.isinf(rows[rows["method"].isin(BROKEN)]["end_error"]).all()
    page = (result / "report.html").read_text()
    assert "RuntimeError: broken" in page
    assert "concludes nothing" in page
    assert faults(result) == []
    (folder / "alone").mkdir()
    assert run(folder / "alone", "--methods", "model")[0].returncode == 0
    apart = pd.read_parquet(folder / "alone" / "out" / "benchmark-quick" / "benchmark.parquet")
    shared = rows[rows["method"].isin(["model", ALONE])].reset_index(drop=True)
    pd.testing.assert_frame_equal(shared, apart)


def test_an_edit_of_an_entrant_runs_its_trials_again_and_no_other(folder):
    trials = folder / "out" / "trials"
    words = ("--methods", "model", "--method", "entrants.Base")
    assert run(folder, *words)[0].returncode == 0
    known = set(trials.iterdir())
    assert run(folder, *words, "--workers", "1")[0].returncode == 0
    assert set(trials.iterdir()) == known
    (folder / "entrants.py").write_text(ENTRANTS.replace("GIVEN = 0.0", "GIVEN = 0.01"))
    done, place = run(folder, *words)
    assert done.returncode == 0
    new = [json.loads(path.read_text())["rows"] for path in set(trials.iterdir()) - known]
    rows = pd.read_parquet(place / "benchmark.parquet")
    changed = rows[(rows["method"] == "Base") & (rows["setting"] == "default")]["end_error"].tolist()
    assert {row["end_error"] for own in new for row in own} >= set(changed)
    entry = json.loads((place / "benchmark.json").read_text())
    assert entry["methods"]["Base"]["custom_code"] is not None
    assert entry["methods"]["model"]["custom_code"] is None


def test_the_table_has_the_same_bytes_with_any_number_of_workers(folder, tmp_path):
    (tmp_path / "entrants.py").write_text(ENTRANTS)
    tables = []
    for workers in ("1", "2"):
        place = tmp_path / workers
        words = ("--quick", "--methods", "cmac", "--workers", workers, "--folder", str(place))
        done = python("-m", "pipelines.benchmark", *words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        tables.append((place / "benchmark-quick" / "benchmark.parquet").read_bytes())
    assert tables[0] == tables[1]


def test_an_entrant_gets_the_stiffness_that_the_designer_believes(folder, monkeypatch):
    monkeypatch.syspath_prepend(str(folder))
    machine, (_, spy) = MACHINES[LEG], choose_methods("feedback_alone", ["entrants.Spy"])
    world = machine.draw(0)
    trial = Trial(machine, spy, DEFAULT, (0,), TASKS)
    true = float(dict(text.split("=") for text in world)["terrain.stiffness"])
    assert abs(true - 10.0) > 0.1
    scenario = make_scenario(compose_config(trial.list_overrides(world, "cycles=1")))
    assert scenario.feedforward.believed == 10.0
    assert scenario.setup.config.terrain.stiffness == pytest.approx(true)


def test_results_of_another_version_are_not_compared(result, tmp_path):
    other = tmp_path / "benchmark.parquet"
    other.write_bytes((result / "benchmark.parquet").read_bytes())
    words = ("-m", "pipelines.benchmark", "--compare", str(result / "benchmark.parquet"), str(other))
    done = python(*words, folder=tmp_path)
    assert done.returncode == 2
    assert "with benchmark.json beside it" in done.stderr
    entry = json.loads((result / "benchmark.json").read_text())
    for version, code, said in ((1, 0, "no other score has changed"), (2, 2, "has another version than")):
        other.with_suffix(".json").write_text(json.dumps(entry | {"version": version}))
        done = python(*words, folder=tmp_path)
        assert (done.returncode, said in done.stdout + done.stderr) == (code, True)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--machine", "cow"), "choose from leg, quadruped, go1, mini_cheetah, all"),
        (("--methods", "cmack"), "choose from feedback_alone, model,"),
        (("--method", "entrants.Nothing"), "has no Nothing"),
        (("--method", "numpy.ndarray"), "must be a feedforward with predict, or a controller with act"),
    ],
)
def test_wrong_words_are_refused_before_anything_is_run(folder, words, said):
    done, _ = run(folder, *words)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_every_method_is_tuned_over_as_many_settings_and_a_larger_number_has_those_of_a_smaller():
    for method in list_methods():
        few, many = (draw_settings(method, number) for number in (3, 30))
        assert few[0] == DEFAULT
        assert few == many[: len(few)]
        assert len(many) == (31 if method.tuned else 1)


def test_the_setting_with_the_least_mean_score_is_chosen():
    scores = {(): np.array([[0.2, 0.4]]), ("a=1",): np.array([[0.1, 0.3]]), ("a=2",): np.array([[0.3, 0.1]])}
    assert choose_setting(list(scores), scores) == ("a=1",)
    assert choose_setting(list(scores)[::-1], scores) == ("a=2",)
