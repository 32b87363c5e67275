"""What a recording shows: axes, moments, views, and the values of the trace."""

import numpy as np
import pytest
from rerun.chunk import RrdReader
from support.doors import CmacexpError
from support.recordings import lines, read_rows, values
from support.views import make_walk

from cmacexp.recording import viewer
from cmacexp.recording.entities import FINENESS
from cmacexp.recording.scene import _turn_from_up
from cmacexp.recording.series import find_events

DRAWN = 0.51 * FINENESS
"""Rounding of what is drawn, m, and a little for single precision."""


def test_a_link_without_length_is_not_turned():
    turns = _turn_from_up(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]))
    assert turns.round(3).tolist() == [[0.0, 0.0, 0.0, 1.0], [0.0, 0.707, 0.0, 0.707]]


def test_moments_are_the_planned_ones_until_the_contact_follows():
    force = make_walk().trace["force"].copy()
    force[6:8, 2], force[10:13, 2] = 1.0, 0.0  # leaves the ground and comes back late
    events = {text: row for row, text in find_events(make_walk(force=force))}
    expected = {"cycle 1 begins": 0, "foot 1 lifts": 6, "foot 1 touches down": 10, "foot 2 touches down": 10}
    expected |= {"foot 3 lifts": 8, "foot 3 touches down": 13}
    assert events | expected == events


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
    expected = {leg: {"world/travel/eyes/right_side"}, walk: {"world/travel", *eyes}}
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
    assert len({RrdReader(run.folder / "recording.rrd").recordings()[0].application_id for run in expected}) == 2


def test_a_run_shows_its_recording_in_a_window_and_needs_a_display(leg, monkeypatch):
    shown = []
    monkeypatch.setattr(viewer, "open_window", shown.append)
    monkeypatch.setenv("DISPLAY", ":0")
    leg.view()
    assert shown == [leg.folder / "recording.rrd"]
    for name in viewer.DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(CmacexpError, match="--web"):
        leg.view()
