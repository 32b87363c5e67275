"""In which settings runs differ, and how they are named by them."""

import pytest
from support.made_studies import made_run

from cmacexp.metrics.swept import find_swept, name_runs


def swept(*configs):
    runs = [made_run(str(folder), "completed", **config) for folder, config in enumerate(configs)]
    found = find_swept(runs)
    return found.keys, found.linked, found.seeds


def test_keys_that_differ_between_the_same_runs_are_one_and_what_a_scenario_decides_goes_with_it():
    keys = ("seed", "machine.leg.mass", "machine.legs.left.mass", "record.r")
    a, b, c = (dict(zip(keys, values, strict=True)) for values in ((1, 1, 1, 1), (2, 2, 2, 2), (3, 2, 2, 2)))
    assert swept(a, b, c) == (["machine.leg.mass"], {"machine.leg.mass": ["machine.legs.left.mass"]}, ["seed"])
    assert swept(b, c) == (["seed"], {}, [])
    assert swept(a, a) == ([], {}, [])
    runs = [{"scenario": s, "knee": k, "rate": r} for s, k, r in (("a", 1, 1), ("b", 0, 1), ("c", 0, 1), ("c", 0, 2))]
    assert swept(*runs) == (["scenario", "rate"], {"scenario": ["knee"]}, [])
    robots = [{"posture.gain": gain, "machine.model": model} for gain, model in ((1, "go2"), (2, "go1"))]
    assert swept(*robots) == (["machine.model"], {"machine.model": ["posture.gain"]}, [])


@pytest.mark.parametrize(
    ("key", "first", "second", "expected"),
    [
        ("cmac.layers", 8, 16, ["layers 8", "layers 16"]),
        ("scenario", "one_leg", "quadruped", ["scenario one_leg", "scenario quadruped"]),
        ("record.r", 1, 2, ["a", "b"]),
    ],
)
def test_runs_are_named_by_what_differs_or_by_their_folders_if_that_is_nothing(key, first, second, expected):
    runs = [made_run(folder, "completed", **{key: value}) for folder, value in (("a", first), ("b", second))]
    assert name_runs(runs, find_swept(runs).all_keys) == expected
