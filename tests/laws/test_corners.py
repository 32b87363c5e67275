"""Margins of learning: what the corners change, and how they are judged."""

import pytest

from cmacexp.loop.scenario import make_scenario
from cmacexp.stability import corners as margins
from cmacexp.stability.corners import count_corners, judge_corners
from cmacexp.stability.verdict import GROWS, HOLDS, UNDECIDED, Verdict


def test_corners_change_ground_and_masses_but_not_what_is_assumed(make_config, monkeypatch):
    config = make_config("scenario=quadruped", "terrain.stiffness=8000")
    seen = []
    verdicts = iter((HOLDS, HOLDS, GROWS, UNDECIDED))

    def note(corner):
        seen.append(corner)
        return Verdict(next(verdicts), 1.0, 0, ("One.", "Two."))

    monkeypatch.setattr(margins, "assess", note)
    corners = judge_corners(config, 0.25)
    assert count_corners(corners) == "Of 4 corners learning holds in 2, grows in 1, is undecided in 1."
    assert corners[2].describe() == "stiffness x 1.25, masses x 0.75: grows: One. Two."
    assert {corner.terrain.stiffness for corner in seen} == {6000.0, 10000.0}
    assert {corner.assumed_stiffness for corner in seen} == {8000.0}
    assert {corner.controller.position_gain for corner in seen} == {config.controller.position_gain}
    for corner, factor in zip(seen, (0.75, 1.25, 0.75, 1.25), strict=True):
        legs, nominal = corner.machine.legs.in_order, config.machine.legs.in_order
        assert [leg.mass_2 for leg in legs] == pytest.approx([factor * leg.mass_2 for leg in nominal])
        assert corner.machine.body_mass == pytest.approx(factor * config.machine.body_mass)
        assert corner.machine.weight == pytest.approx(factor * config.machine.weight)
        assert [leg.length_1 for leg in legs] == [leg.length_1 for leg in nominal]


def test_masses_that_no_plan_allows_are_undecided(make_config, monkeypatch):
    config = make_config("scenario=quadruped", "terrain.stiffness=200")
    monkeypatch.setattr(margins, "assess", lambda corner: Verdict(HOLDS, 0.9, make_scenario(corner).setup.lead, ()))
    corners = judge_corners(config, 0.9)
    assert [corner.judgement.verdict for corner in corners] == [HOLDS, UNDECIDED] * 2
    assert "gait.lift=0.1: must be at least" in corners[1].describe()
