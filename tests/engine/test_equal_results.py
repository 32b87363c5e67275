"""Keys without effect are found by results: all runs that differ in a key alone, and only those, must be equal."""

from cmacexp.engine.equal_results import Outcome, find_idle_keys

RUNS = [{"a": a, "b": b} for a in (1, 2) for b in (1, 2)]
SEEDS = [{"seed": seed} for seed in range(8)]


def find(results, settings=RUNS, configs="0123456789"):
    pairs = zip(configs, results, strict=False)
    outcomes = [None if result is None else Outcome(lambda found=config: found, result) for config, result in pairs]
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
