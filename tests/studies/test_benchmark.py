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
from cmacexp.study import Results
from pipelines.benchmark import summary
from pipelines.benchmark.benchmark import CYCLES, LEARNERS, MODELS, make_study
from pipelines.benchmark.compare import compare_results
from pipelines.benchmark.entrants import ALONE, CMAC, choose_methods, list_methods
from pipelines.benchmark.results import BY_DEFAULT, FOR_ALL, GUARD, GUARDED, SETTINGS
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

SPOILT = '''
import numpy as np


class Spoilt:
    """Learns as ILC does for four cycles; then adds 2 N m a cycle."""

    acts = True

    def __init__(self, config=None):
        pass

    def reset(self, setup):
        self.torque = np.zeros((*setup.plan.support.shape, setup.mechanism.shape[1]))
        self.lead, self.steps = setup.lead, 0

    def learnt(self):
        return {"steps": np.array(self.steps)}

    def predict(self, reference, learning_error):
        self.torque[(reference.sample - 1 - self.lead) % len(self.torque)] += 0.3 * learning_error
        self.steps += 1
        if self.steps > 4 * len(self.torque) and reference.sample == 0:
            self.torque += 2.0
        return self.torque[reference.sample]
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
    assert f"benchmark version {VERSION}:" in text


@pytest.mark.parametrize(
    "name", [name for name in MACHINES if MACHINES[name].scenario != "robot" or package_models()]
)
def test_feedback_only_completes_every_task(name):
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
        assert code or done.stdout.splitlines()[0] == said


def test_a_change_of_scores_and_one_of_failures_are_compared_apart(result, tmp_path):
    rows = pd.read_parquet(result / "benchmark.parquet")
    own = (rows["method"] == "model") & (rows["setting"] == "default") & (rows["task"] != STRESS)
    rows.loc[own, "end_error"] *= 0.5
    rows.loc[own & (rows["task"] == "slope"), "end_error"] = np.inf
    rows.to_parquet(tmp_path / "benchmark.parquet")
    (tmp_path / "benchmark.json").write_bytes((result / "benchmark.json").read_bytes())
    (line, last) = compare_results(result / "benchmark.parquet", tmp_path / "benchmark.parquet")
    assert line == f"{LEG}, model, default: score times 0.500 [0.500, 0.500], failed 0, then 2"
    assert last == "no other score has changed"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--machine", "cow"), "choose from leg, quadruped, go1, mini_cheetah, all"),
        (("--methods", "cmack"), "choose from feedback_only, model,"),
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


def test_what_the_command_line_called_feedback_alone_is_feedback_only():
    assert [method.name for method in choose_methods("feedback_alone,model", [])] == [ALONE, "model"]


def make_rows(machine, setting, errors, force=1.0):
    """Rows of the table of results from end errors (worlds,) of each method, in mm, the same in each task."""
    return [
        {
            "machine": machine, "method": method, "setting": setting, "task": task, "world": world,
            "status": COMPLETED if np.isfinite(error) else "fell", "end_error": 1e-3 * error,
            "first_error": 1e-3 * error, "worst_error": 1e-3 * error, "force": force, "feedback": error,
            "torque_peak": error, "energy": error, "bytes": 0.0, "errors": [1e-3 * error], "cause": "",
        }
        for task in TASKS for method, own in errors.items() for world, error in enumerate(own)
    ]  # fmt: skip


def test_failures_are_counted_beside_the_mean_and_are_no_part_of_it():
    errors = {ALONE: [10.0, 10.0, 10.0], CMAC: [1.0, 1.2, 1.1], "ILC": [0.5, np.inf, np.inf]}
    frame = pd.DataFrame(make_rows("go1", BY_DEFAULT, errors))
    table = summary.table_scores(frame, "go1").set_index("method")
    assert list(table["failed, default"]) == ["14 of 21", "0 of 21", "0 of 21"]
    assert table["default"]["ILC"].startswith("0.050 [")
    assert table["default"][CMAC].startswith("0.110 [")
    assert "ILC failed in 14 of 21 runs." in summary.describe_order(frame, "go1", BY_DEFAULT)


def test_nothing_is_relative_to_a_reference_that_failed():
    """The task is left out of every mean, and its cells say why; no ratio is 0 or infinite."""
    errors = {ALONE: [10.0, 10.0, 10.0], CMAC: [1.0, 1.2, 1.1]}
    rows = make_rows("go1", BY_DEFAULT, errors)
    for row in rows:
        if row["task"] == "delay" and row["method"] == ALONE and row["world"] > 0:
            row |= dict.fromkeys(("end_error", "first_error", "worst_error", "force", "feedback", "energy"), np.inf)
            row["status"] = "fell"
    frame = pd.DataFrame(rows)
    costs = pd.DataFrame([{"machine": "go1", "method": name, "seconds_per_step": 1e-6} for name in errors])
    tables = [summary.table_costs(frame, costs, "go1"), *(
        table(frame, "go1") for table in (summary.table_scores, summary.table_tasks, summary.table_statistics)
    )]  # fmt: skip
    for table in tables:
        assert not re.search(r"\binf|nan", table.to_string())
    assert tables[2]["delay"].tolist() == ["n/a: the reference fell"] * 2
    assert tables[0].set_index("method")["feedback"][CMAC] == pytest.approx(0.11)
    counted = summary.count_cycles(frame)[CMAC]
    assert np.isnan(counted[TASKS.index("delay"), 1:]).all()
    assert np.isnan(counted).sum() == 2
    absolute = summary.table_absolute(frame).set_index("task")
    assert absolute[f"{ALONE}, completed"]["delay"] == "1 of 3"
    assert absolute[f"{ALONE}, mm"]["stroke"] == "10"
    assert absolute[f"{CMAC}, mm"]["stroke"] == "1.1"
    assert absolute[f"{CMAC}, N"]["stroke"] == "1"


def test_default_settings_run_guarded_too_where_something_learns(result):
    words = pd.read_parquet(result / "benchmark.parquet")
    guarded = words[words["setting"] == GUARDED]
    assert set(guarded["method"]) == {ALONE}  # neither a model nor an entrant without learnt
    assert {method.name for method in list_methods() if method.learns} == set(LEARNERS)


def machine_plan(trial, world):
    return make_scenario(compose_config(trial.list_overrides(world))).setup.plan.support


def test_a_guarded_run_goes_on_with_the_best_cycle_of_the_run_before(folder, monkeypatch):
    """An entrant that learns well and then ever worse: without the guard what is worst is carried over."""
    monkeypatch.syspath_prepend(str(folder))
    (folder / "late.py").write_text(SPOILT)
    machine, (_, own) = MACHINES[LEG], choose_methods("feedback_only", ["late.Spoilt"])
    assert own.learns
    trial = Trial(machine, own, GUARD, (0,), TASKS)
    free = Trial(machine, own, DEFAULT, (0,), TASKS)
    world = machine.draw(0)
    stages = [run_stage(each.list_overrides(world, "cycles=8")) for each in (trial, free)]
    assert [stage.status for stage in stages] == [COMPLETED, COMPLETED]
    cycles = [int(stage.learnt["steps"]) / len(machine_plan(trial, world)) for stage in stages]
    assert cycles == [4.0, 7.0]


def test_the_fastest_rival_is_chosen_in_the_worlds_of_tuning():
    """Not ILC, which is the fastest one in the worlds of the test alone."""
    errors = {name: [1.0, 1.0, 1.0] for name in LEARNERS} | {ALONE: [100.0, 100.0, 100.0]}
    rows = make_rows(LEG, FOR_ALL, errors)
    for row in rows:
        late = {CMAC: 4, "ILC": 1, "RBF": 2}.get(row["method"], 9)
        row["errors"] = [1.0] * (late - 1) + [1e-3] * (12 - late)
    settings = pd.DataFrame(
        [{"machine": LEG, "method": name, CYCLES: 1.0 if name == "RBF" else 3.0} for name in LEARNERS]
    )
    finding = make_study({LEG: MACHINES[LEG]}, [ALONE, *MODELS, *LEARNERS]).findings[f"rapid_{LEG}"]
    results = Results([], {"benchmark": pd.DataFrame(rows), "settings": settings})
    assert finding.judge(results).measured[0].interval.value == 2.0


def test_the_findings_follow_from_the_rows():
    """On the leg every learner is better than the models; on robots ILC is not, and RBF is better than the CMAC."""
    levels = {ALONE: 100.0, **dict.fromkeys(MODELS, 30.0), **dict.fromkeys(LEARNERS, 4.0), CMAC: 3.0}
    rows, chance = [], np.random.default_rng(0)
    for machine in MACHINES:
        robot = machine not in (LEG, "quadruped")
        for setting in SETTINGS:
            own = levels | ({"ILC": 50.0, "RBF": 1.0} if robot else {})
            errors = {name: level * np.exp(0.05 * chance.standard_normal(12)) for name, level in own.items()}
            if setting != GUARDED:
                errors["ILC"][:4] = np.inf
            rows += make_rows(machine, setting, errors)
    settings = [{"machine": m, "method": n, CYCLES: 3.0} for m in (LEG, "quadruped") for n in LEARNERS]
    study = make_study(MACHINES, [*levels])
    results = Results([], {"benchmark": pd.DataFrame(rows), "settings": pd.DataFrame(settings)})
    judged = {name: finding.judge(results) for name, finding in study.findings.items()}
    outcomes = {name: found.outcome for name, found in judged.items()}
    expected = {
        "learners_leg": "yes", "learners_identified_leg": "yes", "learners_go1": "no", "rbf_leg": "no",
        "rbf_go1": "yes", "model_leg": "yes", "identified_leg": "no", "plain_fails_leg": "no", "guarded_leg": "yes",
        "fails_leg": "unclear", "no_winner": "yes", "tuning_leg": "no",
    }  # fmt: skip
    assert {name: outcomes[name] for name in expected} == expected
    assert judged["plain_leg"].measured[0].interval.value == pytest.approx(
        4.0 / 3.0, rel=0.1
    )  # of what both complete
    assert judged["plain_fails_leg"].measured[0].interval.value == pytest.approx(1.0 / 3.0)
    for name in (name for name in study.tables if name.startswith(("scores", "guarded", "statistics", "tasks"))):
        assert len(study.tables[name](results)) >= len(LEARNERS)
    text = summary.write_scores(results.computed["benchmark"])
    assert text.count("With the guard:") == len(MACHINES)
    assert "| 28 of 84 |" in text


def test_findings_that_need_tuning_are_not_judged_where_nothing_was_tuned():
    findings = make_study(MACHINES, [ALONE, *MODELS, *LEARNERS]).findings
    assert {name for name in findings if name.startswith("rapid_")} == {"rapid_leg", "rapid_quadruped"}
    assert {"learners_go1", "identified_mini_cheetah", "no_winner"} <= set(findings)


def test_of_settings_that_fail_as_often_that_with_the_least_mean_score_is_chosen():
    failing = {(): np.array([[0.1, np.inf]]), ("a=1",): np.array([[0.5, 0.6]]), ("a=2",): np.array([[0.5, 0.4]])}
    assert choose_setting(list(failing), failing) == ("a=2",)
    assert choose_setting([()], failing) == ()
    assert choose_setting([("b",), ("c",)], {("b",): np.array([np.inf]), ("c",): np.array([9.0])}) == ("c",)


def test_the_setting_with_the_least_mean_score_is_chosen():
    scores = {(): np.array([[0.2, 0.4]]), ("a=1",): np.array([[0.1, 0.3]]), ("a=2",): np.array([[0.3, 0.1]])}
    assert choose_setting(list(scores), scores) == ("a=1",)
    assert choose_setting(list(scores)[::-1], scores) == ("a=2",)
