"""A run whose learning drifts is named before it falls apart, and none that lasts is."""

import shutil

import numpy as np
import pyarrow as pa
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.command import call
from support.made_traces import make_trace, score
from support.manifests import change_manifest

import cmacexp
from cmacexp.metrics.drift import Drift, DriftDetector, make_drift_entry

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

WINDOW = 10
"""Cycles over which growth is measured."""
FALLING = 0.9 ** np.arange(20.0)


def follow_drift(feedback):
    """Growth and start of drift at all cycles of ``feedback`` (cycles,) or (cycles, legs)."""
    feedback = np.asarray(feedback).reshape(len(feedback), -1)
    return DriftDetector(feedback.shape[1]).add(feedback)


def first_detected(feedback):
    """Cycle in which a drift of one leg was named, and that in which it started; None if there is none."""
    started = follow_drift(feedback)[1][:, 0]
    named = np.flatnonzero(~np.isnan(started))
    return (int(named[0]) + 1, int(started[named[0]])) if len(named) else None


def test_growth_is_the_factor_of_a_geometric_series_whatever_a_single_cycle_is():
    feedback = 2.0 * 1.03 ** np.arange(15.0)
    growth = follow_drift(feedback)[0][:, 0]
    assert np.isnan(growth[: WINDOW - 1]).all()
    assert_allclose(growth[WINDOW - 1 :], 1.03)
    feedback[-1] = 50.0
    assert follow_drift(feedback)[0][-1, 0] == pytest.approx(1.03, abs=0.005)


def test_a_trend_is_named_with_its_first_cycle_once_it_has_risen_by_half():
    """1.03^n reaches 1.5 after 14 cycles; the level is the median of ten."""
    named, started = first_detected([*FALLING, *(FALLING[-1] * 1.03 ** np.arange(1, 60.0))])
    assert abs(started - 20) <= 3
    assert 34 <= named <= 42
    named, started = first_detected(1.001 ** np.arange(500.0))  # though its window hardly rises
    assert started == WINDOW // 2
    assert named == pytest.approx(5 + np.log(1.5) / np.log(1.001), abs=6)


def test_a_drift_is_named_in_the_first_cycle_that_shows_it_with_its_leg():
    """However late the other legs follow; and read from the metrics, with the growth at the end."""
    n = np.arange(60.0)[:, None]
    detector = DriftDetector(3)
    growth, started = detector.add(1.03 ** np.maximum(0.0, n - np.array([30.0, 0.0, 12.0])))
    named = int(np.flatnonzero(~np.isnan(started).all(axis=1))[0])
    assert np.flatnonzero(~np.isnan(started[named])).tolist() == [1]
    assert detector.first == Drift(cycle=int(started[named, 1]), leg=2, named=named + 1, growth=growth[named, 1])
    assert detector.first.growth == pytest.approx(1.03)
    cycle, leg = (each.ravel() for each in np.mgrid[1:61, 1:4])
    table = pa.table({"cycle": cycle, "leg": leg, "drift_cycle": started.ravel(), "feedback_growth": growth.ravel()})
    assert make_drift_entry(table) == {**vars(detector.first), "growth": growth[-1, 1]}
    assert make_drift_entry(table.slice(0, 3 * named)) is None


def test_a_row_knows_nothing_of_later_cycles():
    rng, size = np.random.default_rng(7), (32, 2)
    decay = np.repeat(np.exp(-0.4 * np.arange(8)), 4)[:, None]
    columns = {name: decay * rng.uniform(0.5, 1.5, size) for name in ("x", "y", "tau_feedback_1")}
    force = 1.0 + decay * rng.uniform(0.5, 1.5, size)
    trace = make_trace("TSSS", rows=32, legs=2, in_space=True, force=force, force_desired=1.0, **columns)
    whole = score(trace, 4).legs
    for cycles in range(1, 8):
        begun = score(trace.select(slice(4 * cycles)), 4).legs
        for name in whole.column_names:
            assert_array_equal(begun[name], whole[name].slice(0, 2 * cycles), err_msg=name)


@pytest.mark.ci
def test_the_law_of_the_paper_is_seen_to_drift_before_cycle_100_and_one_with_a_lead_is_not(stored, tmp_path):
    run = stored("scenario=one_leg", "cycles=120", "record=trace")
    drift = run.manifest["drift"]
    assert (drift["leg"], drift["cycle"] < 20, drift["named"] < 100) == (1, True, True)
    assert 1.01 < drift["growth"] < 1.05
    again = shutil.copytree(run.folder, tmp_path / "again")
    change_manifest(again, drift=None)
    done = call("score", again)
    assert done.returncode == 0, done.stderr
    assert cmacexp.load(again).manifest["drift"] == drift, "known from the trace alone"
    lasting = stored("scenario=one_leg", "cycles=120", "record=metrics", "learning.lead=1")
    assert lasting.manifest["drift"] is None
