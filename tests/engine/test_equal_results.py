"""Keys without effect are found by results: all runs that differ in a key alone, and only those, must be equal."""

from dataclasses import replace

import pytest
from support.doors import make_scenario

from cmacexp.experiment.equal_results import Outcome, find_idle_keys, make_outcome
from cmacexp.experiment.run import score_scenario

RUNS = [{"a": a, "b": b} for a in (1, 2) for b in (1, 2)]
SHORT = ("scenario=force_step", "cycles=1", "gait.cycle_time=0.3", "sampling_period=0.01")
SEEDS = [{"seed": seed} for seed in range(8)]


def find(results, settings=RUNS, configs="0123456789"):
    pairs = zip(configs, results, strict=False)
    outcomes = [None if result is None else Outcome(config, result) for config, result in pairs]
    return list(find_idle_keys(settings, outcomes, [str(i) for i in range(len(settings))], "jobs"))


def test_a_key_had_no_effect_if_all_groups_that_differ_in_it_alone_are_equal():
    ((kind, text),) = find("xyxy")
    assert (kind, text.partition(":")[0]) == ("warning", "a had no effect")
    assert "jobs 0, 2 gave equal results" in text
    assert find("xyxz") == []
    assert [text.partition(" ")[0] for _, text in find("xxxx")] == ["a", "b"]
    assert find(["x", None, "x", None]) == [("warning", "a had no effect: jobs 0, 2 gave equal results")]
    assert find(["x", None, None, "x"]) == [], "they differ in both keys"
    assert find("xx", [{"a": "1"}, {"a": "1.0"}], configs="00") == [], "they are of one config"
    assert [kind for kind, _ in find("xxxxxxxx", SEEDS)] == ["note"]
    assert find("xxxxxxxy", SEEDS) == []
    assert find([], []) == []


@pytest.mark.parametrize(
    ("warn", "status", "missing", "counts"),
    [
        (True, "completed", 0, True),
        (False, "completed", 0, False),
        (True, "failed", 0, False),
        (True, "diverged", 1, False),
    ],
)
def test_runs_that_failed_or_have_no_whole_cycle_or_are_silent_do_not_count(
    make_config, warn, status, missing, counts
):
    config = make_config(*SHORT)
    end, scorer = score_scenario(make_scenario(config))
    outcome = make_outcome(replace(config, warn=warn), status, end.steps - missing, scorer.scores)
    assert (outcome is not None) == counts
