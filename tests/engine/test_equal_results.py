"""Keys without effect are found by results: all runs that differ in a key alone, and only those, must be equal."""

from dataclasses import replace

import pyarrow.parquet as pq
import pytest

import cmacexp
from cmacexp.data.tables import BODY_METRICS, METRICS
from cmacexp.experiment.equal_results import Outcome, find_idle_keys, make_outcome, read_outcome
from cmacexp.experiment.run import run_scenario, score_scenario
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.metric import Index
from cmacexp.metrics.registry import ALL_METRICS

RUNS = [{"a": a, "b": b} for a in (1, 2) for b in (1, 2)]


def find(results, settings=RUNS, configs="0123456789"):
    pairs = zip(configs, results, strict=False)
    outcomes = [None if result is None else Outcome(config, result) for config, result in pairs]
    return list(find_idle_keys(settings, outcomes, [str(i) for i in range(len(settings))], "jobs"))


def test_a_key_had_no_effect_if_all_groups_that_differ_in_it_alone_are_equal():
    equal = "had no effect: jobs 0, 2 gave equal results; the same in 1 more group of jobs"
    assert find("xyxy") == [("warning", f"a {equal}")]
    assert find("xyxz") == []
    assert [text.partition(" ")[0] for _, text in find("xxxx")] == ["a", "b"]


def test_one_pair_is_enough_and_without_one_nothing_is_said():
    assert find(["x", None, "x", None]) == [("warning", "a had no effect: jobs 0, 2 gave equal results")]
    assert find(["x", None, None, "x"]) == [], "they differ in both keys"
    assert find([], []) == []


def test_runs_of_one_config_prove_nothing():
    assert find("xx", [{"a": "1"}, {"a": "1.0"}], configs="00") == []


def test_a_seed_is_noted():
    settings = [{"seed": seed} for seed in range(8)]
    text = "seed changes nothing here, one is enough: jobs 0, 1, 2, 3, ..., 7 gave equal results"
    assert find("xxxxxxxx", settings) == [("note", text)]
    assert find("xxxxxxxy", settings) == []


@pytest.mark.parametrize("scenario", ["one_leg", "quadruped"])
def test_files_of_metrics_hold_nothing_else(scenario, tmp_path):
    """So equal results mean equal hashes."""
    run = cmacexp.run([f"scenario={scenario}", "cycles=1", "record=metrics"], tmp_path / "r")
    for name in {METRICS, BODY_METRICS} & set(run.manifest["files"]):
        table = pq.read_schema(run.folder / name)
        assert set(table.names) <= {"cycle", "leg", *ALL_METRICS}
        assert table.metadata is None
        assert {key.decode() for field in table for key in field.metadata} == set(Index._fields)


def test_runs_in_memory_and_on_disk_are_equal_or_not_alike(make_config, tmp_path):
    """Layers have no effect without a network; a feedback gain has."""
    common = ["scenario=force_step", "cycles=1", "feedforward=none"]
    stored, in_memory = [], []
    for number, own in enumerate((["cmac.layers=8"], ["cmac.layers=16"], ["controller.velocity_gain=6"])):
        config = make_config(*common, *own)
        end, scorer = score_scenario(make_scenario(config))
        in_memory.append(make_outcome(config, end.status, end.steps, scorer.scores))
        run_scenario(config, tmp_path / str(number))
        stored.append(read_outcome(tmp_path / str(number)))
    for first, second, third in (stored, in_memory):
        assert first.result == second.result != third.result
        assert len({first.config, second.config, third.config}) == 3
    assert [each.config for each in stored] == [each.config for each in in_memory]


def test_runs_that_failed_or_have_no_whole_cycle_or_are_silent_do_not_count(make_config, tmp_path):
    config = make_config("scenario=force_step", "cycles=1", "warn=false")
    run_scenario(config, tmp_path / "silent")
    assert read_outcome(tmp_path / "silent") is None
    end, scorer = score_scenario(make_scenario(config))
    loud = replace(config, warn=True)
    assert make_outcome(config, end.status, end.steps, scorer.scores) is None
    assert make_outcome(loud, end.status, end.steps, scorer.scores) is not None
    assert make_outcome(loud, "failed", end.steps, scorer.scores) is None
    assert make_outcome(loud, "diverged", end.steps - 1, scorer.scores) is None
