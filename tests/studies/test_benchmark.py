"""The benchmark: its tasks are frozen, entrants that fail are rows, nothing is run twice or known too early."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from support.command import python
from support.doors import BadInput, compose_config, make_scenario

from cmacexp.study import Results
from pipelines.benchmark import summary
from pipelines.benchmark.benchmark import LEARNERS, MODELS, make_study
from pipelines.benchmark.entrants import (
    ALONE,
    CMAC,
    DECIDING,
    EACH_CYCLE,
    LEG,
    MACHINES,
    STRESS,
    TASKS,
    VERSION,
    change_world,
    choose_methods,
    hash_tasks,
)
from pipelines.benchmark.results import (
    BY_DEFAULT,
    COMPLETED,
    DEFAULT,
    GUARDED,
    SETTINGS,
    choose_setting,
    list_overrides,
)

TASKS_OF_VERSION_1 = "1d580c33a88dc99a624fe5831029e415000b809977914f52236e25704b0521fb"
ENTRANTS = '''
from dataclasses import dataclass

import numpy as np

from cmacexp.config import FeedforwardConfig, number

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


class FromZero(Base):
    @dataclass
    class Config(FeedforwardConfig):
        gain: float = number("", default=0.5, tuned=(0.0, 1.0))


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


class Spoilt(Base):
    """Learns as ILC does for four cycles; then adds 2 N m a cycle."""

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
    assert done.returncode == 0, done.stderr
    place = folder / "out" / "benchmark-quick"
    return place, pd.read_parquet(place / "benchmark.parquet")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmark")
    (folder / "entrants.py").write_text(ENTRANTS)
    return folder


@pytest.fixture
def entrant(folder, monkeypatch):
    """``entrant("Base")`` gives that method."""
    monkeypatch.syspath_prepend(str(folder))
    return lambda name: choose_methods("feedback_only", [f"entrants.{name}"])[name]


# Whole benchmarks


@pytest.mark.ci
def test_an_entrant_that_fails_is_rows_and_an_edit_of_one_runs_its_trials_alone_again(folder):
    entered = [word for name in ("Base", "Raises") for word in ("--method", f"entrants.{name}")]
    place, rows = run(folder, "--methods", "feedback_only", *entered)
    assert set(rows[rows["method"] == "Raises"]["status"]) == {"failed"}
    assert np.isinf(rows[rows["method"] == "Raises"]["end_error"]).all()
    assert (rows[~(rows["method"] == "Raises") & (rows["task"] != STRESS)]["status"] == COMPLETED).all()
    assert set(rows[rows["setting"] == GUARDED]["method"]) == {ALONE}  # nothing else here learns
    assert "concludes nothing" in (place / "report.html").read_text()
    known = set((folder / "out" / "trials").iterdir())
    (folder / "entrants.py").write_text(ENTRANTS.replace("GIVEN = 0.0", "GIVEN = 0.01"))
    place, edited = run(folder, "--methods", "feedback_only", "--method", "entrants.Base", "--workers", "1")
    (folder / "entrants.py").write_text(ENTRANTS)
    new = [json.loads(path.read_text()) for path in set((folder / "out" / "trials").iterdir()) - known]
    changed = edited[(edited["method"] == "Base") & (edited["setting"] == BY_DEFAULT)]["end_error"]
    assert not set(changed) & set(rows["end_error"])
    assert {row["end_error"] for own in new for row in own} >= set(changed)


@pytest.mark.ci
@pytest.mark.parametrize("words", [("--robot", "go2"), ("--log", "simulated", "--kd", "1"), ("--log", "simulated",
                                   "--machine", "go1")])  # fmt: skip
def test_an_option_that_has_no_effect_is_refused(folder, words):
    done = python("-m", "pipelines.benchmark", *words, folder=folder)
    assert (done.returncode, done.stderr.split("=")[0]) == (2, f"error: {words[-2]}")


# Tasks, worlds and entrants


def test_the_tasks_are_those_of_their_version():
    """Whoever changes a task, a world or a protocol raises VERSION, and writes its hash here."""
    assert (VERSION, hash_tasks(MACHINES)) == (1, TASKS_OF_VERSION_1)


def test_worlds_of_tests_and_of_tuning_are_apart_and_the_same_for_all():
    machine = MACHINES[LEG]
    tested, tuned = ({machine.draw(n, tuning) for n in range(20)} for tuning in (False, True))
    assert len(tested) == len(tuned) == 20
    assert not tested & tuned
    assert change_world(["a=2", "b=1"], ["a=x1.5", "c=4"]) == ["a=3", "b=1", "c=4"]


def test_an_entrant_gets_the_stiffness_that_the_designer_believes(entrant):
    overrides = list_overrides(MACHINES[LEG], entrant("Base"), DEFAULT, MACHINES[LEG].draw(0))
    scenario = make_scenario(compose_config(overrides))
    assert scenario.feedforward.believed == 10.0
    assert abs(scenario.setup.config.terrain.stiffness - 10.0) > 0.1


@pytest.mark.parametrize(
    ("methods", "own"),
    [("cmack", []), *(("", [name]) for name in ("entrants.Nothing", "entrants.FromZero", "numpy.ndarray", "no"))],
)
def test_a_method_that_does_not_exist_or_is_none_is_refused(entrant, methods, own):
    with pytest.raises(BadInput, match=r"^--method"):
        choose_methods(methods or "model", own)


def test_the_setting_that_fails_least_and_then_has_the_least_mean_score_is_chosen():
    failing = pd.DataFrame(
        {"overrides": ["", "", "a=1", "a=1", "a=2", "a=2"], "score": [0.1, np.inf, 0.5, 0.6, 0.5, 0.4]}
    )
    assert choose_setting(failing) == choose_setting(failing[::-1]) == "a=2"
    equal = pd.DataFrame({"overrides": ["b", "c", "d"], "score": [np.inf, 9.0, 9.0]})
    assert choose_setting(equal) == "c"


# Tables and findings, of rows made up


def make_rows(machine, setting, errors):
    """Rows of the table of results from end errors (worlds,) of each method, in mm, the same in each task."""
    return [
        {
            "machine": machine, "method": method, "setting": setting, "task": task, "world": world,
            "status": COMPLETED if np.isfinite(error) else "fell", "end_error": 1e-3 * error,
            "first_error": 1e-3 * error, "worst_error": 1e-3 * error, "force": 1.0, "feedback": error,
            "torque_peak": error, "energy": error, "bytes": 0.0, "errors": [1e-3 * error], "cause": "",
        }
        for task in TASKS for method, own in errors.items() for world, error in enumerate(own)
    ]  # fmt: skip


def test_failures_are_counted_beside_the_mean_and_nothing_is_relative_to_a_reference_that_failed():
    """A task whose reference fell is left out of every mean, and its cells say why; no ratio is 0 or infinite."""
    rows = make_rows("go1", BY_DEFAULT, {ALONE: [10.0] * 3, CMAC: [1.0, 1.2, 1.1], "ILC": [0.5, np.inf, np.inf]})
    for row in rows:
        if row["task"] == "delay" and row["method"] == ALONE and row["world"] > 0:
            row |= dict.fromkeys(("end_error", "first_error", "worst_error", "force", "feedback", "energy"), np.inf)
            row["status"] = "fell"
    frame = pd.DataFrame(rows)
    whole = frame[frame["method"] != "ILC"]
    tables = [table(whole, "go1") for table in (summary.table_scores, summary.table_tasks)]
    assert not any(re.search(r"\binf|nan", table.to_string()) for table in tables)
    assert all(cell.startswith("n/a") for cell in tables[1]["delay"])
    scores = summary.table_scores(frame, "go1").set_index("method")
    assert re.fullmatch(r"0.050 \[.*\]; 12 of 18 failed", scores["default"]["ILC"])  # without that task
    assert re.fullmatch(r"0.110 \[[^;]*\]", scores["default"][CMAC])
    ranking = summary.table_ranking(frame)
    assert [*ranking["method"]] == [CMAC, ALONE, "ILC"]  # failures decide before the score
    assert all(cell.startswith("undecided: ") for cell in ranking["go1, 3 worlds"])
    counted = summary.count_cycles(frame[frame["method"].isin([ALONE, CMAC])]).set_index("method").loc[CMAC]
    unknown = counted[counted[summary.CYCLES].isna()]
    assert list(zip(unknown["task"], unknown["world"], strict=True)) == [("delay", 1), ("delay", 2)]


def test_methods_have_places_where_worlds_suffice():
    rows = make_rows("go1", BY_DEFAULT, {name: [level] * DECIDING for name, level in ((ALONE, 9.0), (CMAC, 1.0))})
    ranking = summary.table_ranking(pd.DataFrame(rows))
    assert [cell.split(":")[0] for cell in ranking[f"go1, {DECIDING} worlds"]] == ["1", "2"]


@pytest.mark.ci
def test_the_findings_follow_from_the_rows():
    """On the leg every learner is better than the models; on robots ILC is not, and RBF is better than the CMAC."""
    levels = {ALONE: 100.0, EACH_CYCLE: 6.0, **dict.fromkeys(MODELS, 30.0), **dict.fromkeys(LEARNERS, 4.0), CMAC: 3.0}
    rows, chance = [], np.random.default_rng(0)
    for machine in MACHINES:
        own = levels | ({} if machine in (LEG, "quadruped") else {"ILC": 50.0, "RBF": 1.0})
        for setting in SETTINGS:
            errors = {name: level * np.exp(0.05 * chance.standard_normal(12)) for name, level in own.items()}
            if setting != GUARDED:
                errors["ILC"][:4] = np.inf
            rows += make_rows(machine, setting, errors)
    results = Results([], {"benchmark": pd.DataFrame(rows)})
    expected = {
        "learners_leg": "yes", "learners_identified_leg": "yes", "learners_go1": "no", "rbf_leg": "no",
        "rbf_go1": "yes", "model_leg": "yes", "each_cycle_leg": "yes", "identified_leg": "no",
        "plain_fails_leg": "no", "guarded_leg": "yes", "fails_leg": "unclear", "no_winner": "yes", "tuning_leg": "no",
    }  # fmt: skip
    findings = make_study(MACHINES, [*levels]).findings
    judged = {name: findings[name].judge(results) for name in (*expected, "plain_leg")}
    assert {name: judged[name].verdict for name in expected} == expected
    assert {name for name in findings if name.startswith("tuning_")} == {"tuning_leg", "tuning_quadruped"}
    plain, failing = (judged[name].measured[0].interval.value for name in ("plain_leg", "plain_fails_leg"))
    assert (plain, failing) == (pytest.approx(4.0 / 3.0, rel=0.1), pytest.approx(1.0 / 3.0))  # of what both complete
