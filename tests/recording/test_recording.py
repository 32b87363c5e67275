"""What a recording shows: axes, times, moments."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.views import make_walk

from cmacexp.recording.axes import value_ranges, widen_range
from cmacexp.recording.blueprint import describe_key, layout
from cmacexp.recording.events import find_events


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_an_axis_shows_all_values_and_has_two_marks_but_not_too_many(low, span):
    start, end = widen_range(low, low + span)
    assert start <= low
    assert low + span <= end
    mark = 10.0 ** np.arange(-8, 9)
    marks = np.floor(end / mark) - np.ceil(start / mark) + 1
    assert ((marks >= 2) & (marks <= 6)).any()


def test_plots_share_an_axis_unless_one_dwarfs_the_other():
    one, larger, dwarfing = (
        value_ranges([make_walk(force=1.0), make_walk(force=force)]) for force in (1.0, 2.0, 50.0)
    )
    assert larger[0]["leg_1/force"] == larger[1]["leg_1/force"]
    assert larger[0]["leg_1/force"][1] > 2.0
    assert dwarfing[0]["leg_1/force"] == one[0]["leg_1/force"]
    assert dwarfing[1]["leg_1/force"][1] > 50.0


def test_moments_are_the_planned_ones_until_the_contact_follows():
    view = make_walk()
    foot_3 = view.legs[2]["force"].copy()
    foot_3[6:8], foot_3[10:13] = 1.0, 0.0  # leaves the ground and comes back late
    legs = [replace(leg, columns={**leg.columns, "force": foot_3}) if leg.number == 3 else leg for leg in view.legs]
    events = {event.text: event.row for event in find_events(replace(view, legs=legs))}
    assert events["cycle 1 begins"] == 0
    assert events["foot 1 lifts"] == 6
    assert events["foot 1 touches down"] == 10
    assert events["foot 3 lifts"] == 8
    assert events["foot 3 touches down"] == 13
    assert events["foot 2 touches down"] == 10


def test_the_key_names_cycles_where_all_runs_show_the_same():
    assert "cycle 3 green" in describe_key([make_walk(3)])
    assert "first cycle orange, last green" in describe_key([make_walk(3), make_walk(4)])


def test_the_first_cycle_stands_beside_the_last_unless_there_is_only_one():
    view = make_walk()
    halves = replace(view, cycle=np.repeat([1, 2], len(view.cycle) // 2), manifest={**view.manifest, "steps": 40})
    tabs = [each.name for each in layout(halves).root_container.contents[1].contents]
    assert tabs[0] == "cycles 1 and 2"
    assert tabs[1:] == ["walk", "whole run", "moments"]
    assert [each.name for each in layout(view).root_container.contents[1].contents] == tabs[1:]
