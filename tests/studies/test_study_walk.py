"""The events of the walk, from a made-up one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmacexp.data.signals import TRUE_MARGINS
from cmacexp.planning.stability import REAR, margins
from cmacexp.recording.run_view import LegView, RunView
from cmacexp.recording.window import Window
from cmacexp.report.run_summary import RunSummary
from cmacexp.study import Results
from cmacexp.study.interval import UNPAIRED
from cmacexp.study.results import Row
from pipelines.quadruped_walking_events import (
    Walk,
    contacts,
    four_feet,
    instants,
    lift_off_of_3,
    touch_down_of_2,
    touch_down_of_3,
)
from pipelines.quadruped_walking_statements import ALL, CLAIMS, FINDINGS, NO_CMAC, SAID, noise_ratio

PERIOD = 0.1
STEPS = 30
TOUCH_DOWN = {1: 0, 2: 15, 3: 24, 4: 9}
HIPS = ((0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2))


def a_walk(force=None, cycles=3) -> Walk:
    """A level machine over its hips' feet in a wave gait of 30 steps, duty factor 0.8; forces (30, 4) as planned
    unless given: 10 N in support, none in transfer."""
    sample = np.arange(STEPS)
    support = np.stack([(sample - TOUCH_DOWN[leg]) % STEPS < 24 for leg in range(1, 5)], axis=1)
    desired = np.where(support, 10.0, 0.0)
    force = desired if force is None else np.asarray(force(desired.copy()))
    zero = np.zeros(STEPS * cycles)
    legs = []
    for i in range(4):
        columns = {"x": zero, "y": zero + 0.5}
        columns |= {"force": np.tile(force[:, i], cycles), "force_desired": np.tile(desired[:, i], cycles)}
        legs.append(LegView(i + 1, "", columns, np.tile(support[:, i], cycles), 0.3, HIPS[i]))
    body = {"height": zero + 0.5} | dict.fromkeys(("cog_x", "cog_y", "yaw", "pitch", "roll"), zero)
    true = margins(np.broadcast_to(HIPS, (len(zero), 4, 2)), np.tile(force > 0.0, (cycles, 1)))
    body |= dict(zip(TRUE_MARGINS, true.T, strict=True))
    step = np.arange(len(zero))
    window = Window(1, cycles, 1, len(zero))
    return Walk(RunView(legs, step * PERIOD, step, step // STEPS + 1, body, {"config": {}}, window, "made", ""))


def changed(rows, leg, value):
    """A walk in which a foot has another force in some steps of each cycle."""

    def force(planned):
        planned[rows, leg - 1] = value
        return planned

    return a_walk(force)


def test_a_walk_as_planned_is_the_wave_of_the_paper():
    found = contacts(a_walk(), 2)
    assert found["duty_factor_off"] == pytest.approx(0.0)
    assert found["wave_off"] == pytest.approx(0.0, abs=1e-12)
    assert found["two_feet"] == 0.0


def test_contacts_are_those_of_the_forces():
    found = contacts(changed(slice(24, 30), 4, 0.0), 2)  # foot 4 also lets go while foot 1 is aloft
    assert found["duty_factor_off"] == pytest.approx(0.2)
    assert found["two_feet"] == pytest.approx(0.2)
    assert contacts(changed(slice(24, 27), 1, 10.0), 2)["wave_off"] == pytest.approx(0.05)  # 1.5 of 30 steps late


def test_the_margin_counts_while_a_foot_still_carries():
    found = touch_down_of_3(changed(slice(24, 26), 1, 3.0), 2)  # foot 3 touches down in step 24; foot 1 should be off
    assert found["force_1"] == 3.0
    assert found["margin"] == pytest.approx(0.2)  # four feet, each 0.2 m from the centre


def test_margins_are_those_of_the_feet_that_carry():
    assert lift_off_of_3(a_walk(), 2)["rear"] == pytest.approx(0.0)  # 1, 2 and 4 leave the centre on the diagonal
    assert touch_down_of_2(a_walk(), 2)["front"] == pytest.approx(0.0)
    walk = changed(18, 3, 4.0)  # foot 3 leaves the ground a step late, and takes the rear edge with it
    assert lift_off_of_3(walk, 2)["rear"] == pytest.approx(0.0)
    two = changed(slice(18, 24), 4, 0.0)  # 1 and 2 carry alone
    assert lift_off_of_3(two, 2)["rear"] == -np.inf


def test_a_force_that_follows_the_margin_correlates_with_it():
    walk = changed(slice(18, 24), 2, np.arange(6.0) + 1.0)
    assert lift_off_of_3(walk, 2)["correlation"] == 0.0  # the margin does not vary
    walk.carried[:, REAR] -= 0.001 * np.arange(len(walk.carried))  # as if the feet moved forward
    assert lift_off_of_3(walk, 2)["correlation"] == pytest.approx(-1.0)


def test_stability_is_restored_when_it_is_for_good():
    bounce = changed(16, 1, 0.0)  # foot 2 touches down in step 15, foot 1 lets go in the next
    assert touch_down_of_2(bounce, 2)["restored"] == pytest.approx(0.2)
    assert touch_down_of_2(a_walk(), 2)["restored"] == 0.0


def test_load_between_the_diagonals_is_distinguished_from_other_errors():
    rocks = a_walk(lambda force: force + np.where((force > 0).all(axis=1)[:, None], [1.0, -1.0, -1.0, 1.0], 0.0))
    assert four_feet(rocks, 2) == pytest.approx({"four_feet": 1.0, "diagonal": 1.0})
    sinks = a_walk(lambda force: np.where(force > 0.0, force + 1.0, 0.0))
    down = 4.0 * 6.0  # squares in the 6 steps with four feet down; three feet in the other 24
    assert four_feet(sinks, 2) == pytest.approx({"four_feet": down / (down + 72.0), "diagonal": 0.0})


def test_instants_follow_the_forces_not_the_plan():
    def shifted(force):
        force[18, 2] = 4.0  # foot 3 leaves the ground a step late
        force[14, 1] = 5.0  # foot 2 comes a step early
        return force

    assert instants(a_walk(), 2) == {17: 48, 18: 54, 19: 44, 20: 45}
    assert instants(a_walk(shifted), 2) == {17: 49, 18: 54, 19: 43, 20: 44}


def test_noise_is_compared_with_one_reference_at_a_time_and_with_no_walk_that_fell():
    rows = [
        {"seed": seed, "controller": controller, "reference": reference, "feet": feet, "force": 1.0}
        for reference, changes in (
            ("literal", {ALL: (3.0, 8.0), NO_CMAC: (2.0, np.inf)}),
            ("aware", {ALL: (1.0, 1.0), NO_CMAC: (4.0, 2.0)}),
        )
        for controller, own in changes.items()
        for seed, feet in enumerate(own)
    ]
    walk = Row(RunSummary(Path("run"), "completed", "", {}, 0, {}), {}, {}, {})
    for reference, ratios in (("literal", [1.5, UNPAIRED]), ("aware", [0.25, 0.5])):
        results = Results([replace(walk, settings={"reference": reference})], {"noise": pd.DataFrame(rows)})
        assert noise_ratio("feet")(results).tolist() == ratios


def test_a_sentence_of_the_paper_is_a_claim_as_printed_and_a_finding_with_the_aware_reference():
    for name, said in SAID.items():
        assert CLAIMS[name].words == said.words
        assert all(each.of["reference"] == "literal" for each in CLAIMS[name].criteria)
        assert all(each.of["reference"] == "aware" for each in FINDINGS[f"aware_{name}"].criteria)
