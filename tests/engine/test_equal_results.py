"""Keys without effect are found by results: all runs that differ in a key alone, and only those, must be equal."""

from cmacexp.engine.equal_results import find_idle_keys
from cmacexp.engine.sweep_tables import collect_settings, read_settings

RUNS = [[f"a={a}", f"b={b}"] for a in (1, 2) for b in (1, 2)]
SEEDS = [[f"seed={seed}"] for seed in range(8)]


def find(results, runs=RUNS):
    settings = collect_settings(map(read_settings, runs))
    return list(find_idle_keys(settings, results, [str(i) for i in range(len(runs))], "jobs"))


def test_a_key_had_no_effect_if_all_groups_that_differ_in_it_alone_are_equal():
    ((kind, text),) = find("xyxy")
    assert (kind, text.partition(":")[0]) == ("warning", "a had no effect")
    assert "jobs 0, 2 gave equal results" in text
    assert find("xyxz") == []
    assert [text.partition(" ")[0] for _, text in find("xxxx")] == ["a", "b"]
    assert find(["x", "", "x", ""]) == [("warning", "a had no effect: jobs 0, 2 gave equal results")]
    assert find(["x", "", "", "x"]) == [], "they differ in both keys"
    assert find("xx", [["a=1"], ["a=1.0"]]) == [], "the value is the same"
    assert find("xx", [["a=1"], []]) == [], "1 may be what a is without the override"
    assert find("xx", [["record.weights=true"], ["record.weights=false"]]) == [], "it changes no result of any run"
    assert [kind for kind, _ in find("xxxxxxxx", SEEDS)] == ["note"]
    assert find("xxxxxxxy", SEEDS) == []
    assert find([], []) == []
