"""A run whose learning drifts is named before it falls apart, and none that lasts is."""

import json

import numpy as np
import pyarrow as pa
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.command import cmacexp
from support.made_traces import compute, make_trace, measure
from support.manifests import change_manifest

from cmacexp.commands.score import score
from cmacexp.metrics.drift import DRIFT_RATIO, Drift, DriftDetector, make_drift_entry
from cmacexp.metrics.registry import METRICS
from cmacexp.models.trend import WINDOW

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

FALLING = 0.9 ** np.arange(20.0)


def follow_drift(feedback):
    """Growth and start of drift at all cycles of ``feedback`` (cycles, legs)."""
    return DriftDetector(feedback.shape[1]).add(feedback)


def first_detected(feedback):
    """Cycle in which a drift of one leg was named, and that in which it started; None if there is none."""
    started = follow_drift(np.asarray(feedback)[:, None])[1][:, 0]
    named = np.flatnonzero(~np.isnan(started))
    return (int(named[0]) + 1, int(started[named[0]])) if len(named) else None


def test_growth_of_a_geometric_series_is_its_factor():
    growth = follow_drift(2.0 * 1.03 ** np.arange(15.0)[:, None])[0][:, 0]
    assert np.isnan(growth[: WINDOW - 1]).all()
    assert_allclose(growth[WINDOW - 1 :], 1.03)


def test_growth_is_not_moved_by_a_cycle_that_is_out_of_line():
    feedback = 1.02 ** np.arange(12.0)
    feedback[-1] = 50.0
    assert follow_drift(feedback[:, None])[0][-1, 0] == pytest.approx(1.02, abs=0.005)


def test_a_trend_that_starts_after_learning_is_named_with_its_cycle():
    named, started = first_detected([*FALLING, *(FALLING[-1] * 1.03 ** np.arange(1, 60.0))])
    assert abs(started - 20) <= 3
    # 1.03^n reaches 1.5 after 14 cycles; the level is the median of ten.
    assert 34 <= named <= 42


@pytest.mark.parametrize(("share", "harms"), [(0.97, False), (1.1, True)])
def test_feedback_that_is_small_against_its_highest_level_may_rise(share, harms):
    rising = 1e-3 * 1.01 ** np.arange(1000.0)
    found = first_detected([*np.ones(20), *rising[rising < share * DRIFT_RATIO * 0.01]])
    assert (found is not None) == harms


@pytest.mark.parametrize("drifts", [True, False])
def test_the_first_drift_of_a_run_is_read_from_its_metrics(drifts):
    feedback = np.stack([np.ones(60), (1.03 if drifts else 1.0) ** np.arange(60.0)], axis=1)
    detector = DriftDetector(2)
    growth, started = detector.add(feedback)
    cycle, leg = (each.ravel() for each in np.mgrid[1:61, 1:3])
    table = {"cycle": cycle, "leg": leg, "drift_cycle": started.ravel(), "feedback_growth": growth.ravel()}
    found = make_drift_entry(pa.table(table))
    assert found == (detector.first and {**detector.first._asdict(), "growth": growth[-1, 1]})
    assert (found is not None) == drifts


def test_a_slow_trend_is_named_too_though_its_window_hardly_rises():
    named, started = first_detected(1.001 ** np.arange(500.0))
    assert started == WINDOW // 2
    assert named == pytest.approx(5 + np.log(1.5) / np.log(1.001), abs=6)


@pytest.mark.parametrize(
    "feedback",
    [
        0.97 ** np.arange(2000.0),
        np.ones(2000),
        [1.0, 4.0, 0.5, 2.0, 0.9, 1.5, *FALLING],
        [*FALLING, *(5.0 * FALLING)],
        [*FALLING, *(FALLING[-1] * 1.04 ** np.arange(10.0)), *([FALLING[-1] * 1.48] * 50)],
        [1.0] * 10 + [1e-12 * 1.1**n for n in range(100)],
        np.zeros(50),
        [*FALLING, np.inf],
    ],
    ids=["decay", "standing", "transient", "relearning", "below the rise", "as good as nothing", "zero", "last inf"],
)
def test_what_lasts_is_never_named(feedback):
    assert first_detected(feedback) is None


@pytest.mark.parametrize("seed", range(20))
def test_noise_is_no_trend(seed):
    noise = np.random.default_rng(seed).normal(1.0, 0.1, 3000)
    assert first_detected(noise) is None


def test_a_drift_stays_named_also_if_learning_recovers():
    feedback = [*FALLING, *(FALLING[-1] * 1.05 ** np.arange(20.0)), *FALLING]
    started = follow_drift(np.array(feedback)[:, None])[1][:, 0]
    named = first_detected(feedback)[0]
    assert len(set(started[named - 1 :])) == 1


@pytest.mark.parametrize("size", [1, 3, 7, 200])
def test_a_run_watched_in_parts_is_told_as_one_watched_at_once(size):
    n = np.arange(150.0)[:, None] + np.arange(3)
    feedback = np.abs(np.sin(0.01 * n)) + 0.1 * 1.02**n
    detector = DriftDetector(3)
    parts = [detector.add(feedback[n : n + size]) for n in range(0, len(feedback), size)]
    for part, at_once in zip(zip(*parts, strict=True), DriftDetector(3).add(feedback), strict=True):
        assert_array_equal(np.concatenate(part), at_once)


def test_a_drift_is_named_in_the_first_cycle_that_shows_it_with_its_leg():
    """However late the other legs follow."""
    n = np.arange(60.0)[:, None]
    feedback = 1.03 ** np.maximum(0.0, n - np.array([30.0, 0.0, 12.0]))
    detector = DriftDetector(3)
    growth, started = detector.add(feedback)
    cycle = int(np.flatnonzero(~np.isnan(started).all(axis=1))[0])
    assert np.flatnonzero(~np.isnan(started[cycle])).tolist() == [1]
    assert detector.first == Drift(int(started[cycle, 1]), 2, cycle + 1, growth[cycle, 1])
    assert detector.first.growth == pytest.approx(1.03)


def test_change_of_the_feedback_is_that_from_the_cycle_before():
    torque = np.repeat([1.0, 4.0, 2.0], 4)
    measured = measure("TTSS", rows=12, tau_feedback_1=torque, tau_feedback_2=0.0)
    assert_allclose(measured["feedback_change"], np.array([np.nan, 3.0, 2.0]) / np.sqrt(2.0))


@pytest.fixture(scope="module")
def drifting(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drifting")
    return folder, cmacexp("scenario=one_leg", "cycles=120", "record=trace", "hydra.run.dir=.", folder=folder)


def test_the_paper_s_law_is_seen_to_drift_before_cycle_100(drifting):
    folder, done = drifting
    drift = json.loads((folder / "manifest.json").read_text())["drift"]
    assert (drift["leg"], drift["cycle"] < 20, drift["named"] < 100) == (1, True, True)
    assert 1.01 < drift["growth"] < 1.05
    said = f"drift detected in cycle {drift['named']}, started in cycle {drift['cycle']} (feedback of leg 1 grows "
    assert f"warning: {said}" in done.stderr
    assert said in done.stdout
    assert "explain:   python -m cmacexp.stability .\n" in done.stdout


def test_the_drift_is_known_from_the_trace_alone(drifting):
    folder, _ = drifting
    manifest = json.loads((folder / "manifest.json").read_text())
    change_manifest(folder, drift=None)
    assert make_drift_entry(score(folder).legs) == manifest["drift"]
    assert json.loads((folder / "manifest.json").read_text())["drift"] == manifest["drift"]


@pytest.mark.parametrize("overrides", [["learning.lead=1"], ["feedforward=none"], ["feedforward=inverse_dynamics"]])
def test_a_run_that_lasts_is_not_named(tmp_path, overrides):
    thin = ("record=trace", "record.every_nth_step=600", "hydra.run.dir=.")
    done = cmacexp("cycles=300", *thin, *overrides, folder=tmp_path)
    assert json.loads((tmp_path / "manifest.json").read_text())["drift"] is None
    assert "drift" not in done.stdout + done.stderr


def learning(cycles, legs=1):
    """A trace of ``cycles`` cycles of four steps whose errors change from cycle to cycle and leg to leg."""
    rng = np.random.default_rng(7)
    size = (4 * cycles, legs)
    decay = np.repeat(np.exp(-0.4 * np.arange(cycles)), 4)[:, None]
    columns = {name: decay * rng.uniform(0.5, 1.5, size) for name in ("x", "y", "tau_feedback_1")}
    return {"rows": 4 * cycles, "legs": legs, "force": 1.0 + decay * rng.uniform(0.5, 1.5, size), **columns}


def test_a_row_knows_nothing_of_later_cycles():
    trace = make_trace("TSSS", **learning(8, legs=2), force_desired=1.0)
    whole = compute(trace, 4)
    for cycles in range(1, 8):
        begun = compute(trace.slice(0, 8 * cycles), 4)
        for name in METRICS:
            assert_array_equal(
                begun.column(name).to_numpy(), whole.column(name).to_numpy()[: 2 * cycles], err_msg=name
            )
