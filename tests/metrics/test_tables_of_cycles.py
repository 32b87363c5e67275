"""Laws of the tables of cycles: which metrics they show, which cycles of a long run, and how legs are pooled."""

import math
import statistics
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.made_traces import make_trace

from cmacexp.data.signals import TRUE_MARGINS
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import Traces
from cmacexp.experiment.run import run_scenario
from cmacexp.metrics.metric import NEITHER
from cmacexp.metrics.pooling import BETWEEN, ENDS, MOST_ROWS, select_main, shorten
from cmacexp.metrics.registry import ALL_METRICS, JUDGED, MAIN, RANKED, SHOWN
from cmacexp.metrics.score import RunScorer, score_traces
from cmacexp.metrics.text import format_cell
from cmacexp.typing import Array

BODY_COLUMNS = ("height", "pitch", "roll", "stability_margin", "margin_front", "margin_rear", *TRUE_MARGINS)


def random_trace(legs, cycles=3, seed=0):
    """A trace of noise, six samples a cycle."""
    rng, rows = np.random.default_rng(seed), 6 * cycles
    torques = {f"tau_{part}_{joint}" for part in ("feedback", "feedforward") for joint in (1, 2)}
    columns = {name: rng.normal(size=(rows, legs)) for name in ("x", "y", *sorted(torques))}
    columns |= {"force": rng.uniform(0.5, 1.5, (rows, legs)), "force_desired": 1.0}
    return make_trace("TTSSSS", rows, legs, **columns)


def columns(table) -> dict[str, Array]:
    return {name: np.asarray(table[name]) for name in table.column_names}


@given(st.integers(0, 400))
def test_a_long_table_keeps_its_ends_and_rows_between_them_at_even_distances(number):
    rows = list(range(number))
    kept = shorten(rows)
    if number <= MOST_ROWS:
        assert kept == rows
    else:
        assert len(kept) == 2 * ENDS + BETWEEN < number
        assert kept[:ENDS] == rows[:ENDS]
        assert kept[-ENDS:] == rows[-ENDS:]
        gaps = np.diff(kept[ENDS - 1 : -ENDS + 1])
        assert gaps.min() >= 1
        assert np.ptp(gaps) <= 1


def by_hand(values):
    """What the names of poolings promise."""
    return {
        "mean": statistics.fmean(values),
        "RMS": math.sqrt(statistics.fmean(value**2 for value in values)),
        "largest": max(values),
        "smallest": min(values),
        "": statistics.fmean(values),
    }


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=4), st.integers(0, 3))
def test_poolings_do_what_their_names_say_with_the_legs_that_define_a_metric(values, undefined):
    for metric in ALL_METRICS.values():
        name, pool = metric.pooling.name, metric.pooling.pool
        both = np.array([[*values, *[math.nan] * undefined], [math.nan] * (len(values) + undefined)])
        assert_allclose(pool(both), [by_hand(values)[name], math.nan], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("cuts", [(), (1,), (2, 3)])
def test_a_run_in_parts_of_whole_cycles_has_the_scores_of_the_run(cuts):
    trace = random_trace(2, cycles=4)
    body = pa.table({name: np.random.default_rng(1).normal(size=24) for name in BODY_COLUMNS})
    parts, whole = RunScorer(6), RunScorer(6)
    whole.add_legs(trace)
    whole.add_body(body)
    ends = [0, *cuts, 4]
    for begin, end in pairwise(ends):
        rows = 6 * (end - begin)
        parts.add(Traces(trace.slice(12 * begin, 2 * rows), body.slice(6 * begin, rows), None))
    for one, other in zip(parts.scores, whole.scores, strict=True):
        assert one.column_names == other.column_names
        for name, values in columns(one).items():
            assert_array_equal(values, columns(other)[name], err_msg=name)


@pytest.mark.parametrize("scenario", ["one_leg", "quadruped"])
def test_stored_traces_have_the_scores_of_their_run(make_config, tmp_path, scenario):
    short = ("gait.cycle_time=0.2", "gait.lift=0.005", "cycles=3", "learning.start_cycle=2", "record=trace")
    run_scenario(make_config(f"scenario={scenario}", *short), tmp_path)
    run = StoredRun(tmp_path)
    assert "weight_norm" in columns(run.scores.legs)
    assert (run.scores.body is None) == (scenario == "one_leg")
    for one, other in zip(score_traces(run), run.scores, strict=True):
        if one is not None:
            for name, values in columns(one).items():
                assert_array_equal(values, columns(other)[name], err_msg=name)


def test_a_main_metric_is_shown_if_one_cycle_defines_it_and_it_suits_the_number_of_legs():
    undefined = dict.fromkeys(MAIN, np.array([math.nan, math.nan]))
    assert select_main(undefined, 1) == {}
    assert select_main({}, 4) == {}
    for name, shown in MAIN.items():
        values = {each: own for each, own in undefined.items() if each != shown.instead}
        values |= {name: np.array([math.nan, 2.0])}
        assert select_main(values, 1) == {name: shown}
        assert select_main(values, 4) == ({name: shown} if shown.over_legs else {})


def test_a_metric_is_judged_and_ranked_if_one_of_two_values_is_the_better_one():
    for name, metric in ALL_METRICS.items():
        best = metric.find_best(np.array([1.0, 2.0]))
        assert math.isnan(best) == (metric.better == NEITHER)
        assert (name in JUDGED) == (name in MAIN and not math.isnan(best))
        assert (name in RANKED) == (name in SHOWN and not math.isnan(best))


@given(st.floats(-1e9, 1e9))
def test_a_number_is_shown_to_three_decimals_or_three_digits(value):
    shown = format_cell(value)
    assert len(shown) <= 9
    assert float(shown) == pytest.approx(value, rel=0.005, abs=5.01e-4)
    assert format_cell(math.nan) == "-"
