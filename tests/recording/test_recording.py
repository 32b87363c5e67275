"""What a recording shows: axes, moments, views, and the values of the trace."""

from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader
from support.doors import BadInput
from support.recordings import lines, read_rows, values
from support.views import make_walk

from cmacexp.recording.entities import FINENESS
from cmacexp.recording.events import find_events
from cmacexp.recording.window import MOST_STEPS, make_window, read_cycles

DRAWN = 0.51 * FINENESS
"""Rounding of what is drawn, m, and a little for single precision."""


@pytest.fixture(scope="module")
def leg(stored):
    return stored("scenario=one_leg", "cycles=3", "record.weights=true")


@pytest.fixture(scope="module")
def walk(stored):
    return stored("scenario=quadruped", "cycles=1")


def test_moments_are_the_planned_ones_until_the_contact_follows():
    view = make_walk()
    foot_3 = view.legs[2]["force"].copy()
    foot_3[6:8], foot_3[10:13] = 1.0, 0.0  # leaves the ground and comes back late
    legs = [replace(leg, columns={**leg.columns, "force": foot_3}) if leg.number == 3 else leg for leg in view.legs]
    events = {event.text: event.row for event in find_events(replace(view, legs=legs))}
    expected = {"cycle 1 begins": 0, "foot 1 lifts": 6, "foot 1 touches down": 10, "foot 2 touches down": 10}
    expected |= {"foot 3 lifts": 8, "foot 3 touches down": 13}
    assert events | expected == events


def test_windows_of_cycles_and_the_thinning_of_long_runs():
    asked = {"3-5": (3, 5), "7": (7, 7), "last": (9, 9), "last9": (1, 9)}
    assert {text: read_cycles(text, 9) for text in asked} == asked
    for text in ("5-3", "0", "10", "last10", "x"):
        with pytest.raises(BadInput, match="--cycles"):
            read_cycles(text, 9)
    kept, sharing = {1: 600, 2: 600}, 3 * MOST_STEPS // 1200
    every = [make_window(kept, sharing=number).every for number in (1, sharing, sharing + 1)]
    assert every == [1, 3, 4]


def test_a_recording_has_the_values_of_the_trace(leg):
    path, trace = leg.folder / "recording.rrd", leg.trace
    steps, force = lines(path, "leg_1/force")
    assert steps.tolist() == trace.step.tolist()
    assert (force == trace[["force_desired", "force"]].to_numpy(np.float32)).all()
    error = 1e3 * (trace[["x", "y"]].to_numpy() - trace[["x_desired", "y_desired"]].to_numpy())
    assert (lines(path, "leg_1/error")[1] == error.astype(np.float32)).all()
    torque = trace[["tau_feedback_2", "tau_feedforward_2"]].to_numpy(np.float32)
    assert (lines(path, "leg_1/torque_2")[1] == torque).all()
    _, foot = values(path, "world/feet", "Ellipsoids3D:centers")
    drawn = np.stack([trace.x, 0.5 - trace.y], axis=1)
    np.testing.assert_allclose(foot[:, 0, [0, 2]], drawn, rtol=0.0, atol=DRAWN)


def test_every_leg_of_a_walk_and_its_body_are_shown(walk):
    path, trace = walk.folder / "recording.rrd", walk.trace
    for number, of_leg in trace.groupby("leg"):
        force = lines(path, f"leg_{number}/force")[1]
        assert (force == of_leg[["force_desired", "force"]].to_numpy(np.float32)).all()
    assert lines(path, "body/height")[1][:, 0] == pytest.approx(1e3 * walk.body.height.to_numpy())


def test_views_look_at_entities_of_the_run_and_facts_are_those_of_its_manifest(leg, walk):
    eyes = {f"world/travel/eyes/{eye}" for eye in ("front", "right_side", "top")}
    expected = {leg: {"world/travel/eyes/right_side"}, walk: {"gait", "world/travel", *eyes}}
    for run, own in expected.items():
        path, origins = run.folder / "recording.rrd", set()
        for _, row in read_rows(path, store=lambda reader: reader.blueprints()[0]):
            origins.update(origin.strip("/") for origin in row.get("ViewBlueprint:space_origin") or ())
        assert origins == own | {"series", "events", "key"}
        rows = [row for _, row in read_rows(path, "/__properties/**")]
        facts = {name: value[0] for row in rows for name, value in row.items() if isinstance(value, list) and value}
        assert (facts["status"], facts["seed"]) == ("completed", 0)
        assert facts["cmac.layers"] == run.config["cmac"]["layers"]
        assert len(RrdReader(path).recordings()) == 1
