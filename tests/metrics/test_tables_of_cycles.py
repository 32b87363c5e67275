"""Laws of the tables of cycles: which metrics they show, which cycles of a long run, and how legs are pooled."""

import math
import statistics
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import Trace
from support.made_traces import make_trace, score

from cmacexp.metrics.body import BODY_METRICS
from cmacexp.metrics.metric import LARGE, LARGEST, MEAN, NEITHER, RMS, SMALL, SMALLEST
from cmacexp.metrics.registry import (
    ALL_METRICS,
    JUDGED,
    MAIN,
    RANKED,
    SHOWN,
    format_cell,
    pool_legs,
    select_main,
    tabulate_cycles,
)

BODY_COLUMNS = ("height", "pitch", "roll", *(name.removesuffix("_min") for name in BODY_METRICS if "margin" in name))


POOL = {
    "mean": statistics.fmean,
    "RMS": lambda values: math.sqrt(statistics.fmean(value**2 for value in values)),
    "largest": max,
    "smallest": min,
    "": statistics.fmean,
}
"""What the names of poolings promise."""


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=4), st.integers(0, 3))
def test_poolings_do_what_their_names_say_with_the_legs_that_define_a_metric(values, undefined):
    both = np.array([[*values, *[math.nan] * undefined], [math.nan] * (len(values) + undefined)])
    for pooling in {metric.pooling for metric in ALL_METRICS.values()}:
        assert_allclose(pooling.pool(both), [POOL[pooling.name](values), math.nan], rtol=1e-12, atol=1e-12)


def test_every_metric_is_pooled_as_declared_and_shown_pooled():
    """Of four cycles of noise of two legs and a body, six samples a cycle."""
    rng = np.random.default_rng(0)
    names = ("x", "y", *(f"tau_{part}_{joint}" for part in ("feedback", "feedforward") for joint in (1, 2)))
    columns = {name: rng.normal(size=(24, 2)) for name in names}
    legs = make_trace("TTSSSS", 24, 2, force=rng.uniform(0.5, 1.5, (24, 2)), force_desired=1.0, **columns)
    body = pa.table({name: rng.normal(size=24) for name in BODY_COLUMNS})
    scores = score(replace(legs, body=Trace(body)), 6)
    pooled, (main, rows) = pool_legs(scores), tabulate_cycles(scores)
    for name, values in pooled.items():
        of_legs = np.asarray((scores.body if name in BODY_METRICS else scores.legs)[name]).reshape(4, -1)
        assert_array_equal(values, ALL_METRICS[name].pooling.pool(of_legs), err_msg=name)
    assert {*pooled} == {*scores.legs.column_names, *scores.body.column_names} - {"cycle", "leg"}
    assert list(main) == list(select_main(pooled, 2))
    texts = [[format_cell(pooled[name][cycle] * main[name].factor) for name in main] for cycle in range(4)]
    assert rows == [[str(cycle), *row] for cycle, row in enumerate(texts, 1)]


def test_a_main_metric_is_shown_if_one_cycle_defines_it_and_it_suits_the_number_of_legs():
    undefined = dict.fromkeys(MAIN, np.array([math.nan, math.nan]))
    assert select_main(undefined, 1) == select_main({}, 4) == {}
    for name, shown in MAIN.items():
        values = {each: own for each, own in undefined.items() if each != shown.instead}
        values |= {name: np.array([math.nan, 2.0])}
        assert select_main(values, 1) == {name: shown}
        assert select_main(values, 4) == ({name: shown} if shown.over_legs else {})


FAMILIES = {
    "_time": (LARGEST, SMALL),
    "_rms": (RMS, None),
    "_ripple": (RMS, None),
    "_change": (RMS, None),
    "_iae": (MEAN, SMALL),
    "_itae": (MEAN, SMALL),
    "_peak": (LARGEST, SMALL),
    "_rmse": (RMS, SMALL),
    "drift_cycle": (SMALLEST, NEITHER),
}
"""Pooling and better direction, by the end of the name; None: either."""


def test_a_metric_is_pooled_judged_and_ranked_as_its_family():
    for name, metric in ALL_METRICS.items():
        for end, (pooling, better) in FAMILIES.items():
            if name.endswith(end):
                assert (metric.pooling, metric.better) == (pooling, better or metric.better), name
        assert ("margin" in name) == (name in BODY_METRICS and metric.better == LARGE), name
        best = metric.find_best(np.array([math.nan, -1.0, 3.0]))
        expected = {"small": -1.0, "near 0": -1.0, "large": 3.0, "": math.nan}[metric.better]
        assert best == pytest.approx(expected, nan_ok=True)
        assert (name in JUDGED, name in RANKED) == tuple(
            name in shown and metric.better != NEITHER for shown in (MAIN, SHOWN)
        )
