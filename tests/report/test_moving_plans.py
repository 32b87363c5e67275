"""A plan that moves from cycle to cycle: pages and recordings draw of each cycle what was desired in it."""

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.testing import assert_allclose
from rerun.chunk import RrdReader
from support.views import STEPS, make_robot_traces

from cmacexp.data.tables import Traces
from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import make_view
from cmacexp.recording.scene import log_machine
from cmacexp.report.cycle_data import CycleData
from cmacexp.report.figures import DESIRED_LINE
from cmacexp.report.run_figures import draw_tracking, over_cycle
from cmacexp.report.style import pale

LEGS = range(1, 5)
SHIFTS = (0.0, 0.01, 0.01)
"""Of the desired path along x in each cycle, m."""
LOADS = (0.0, 15.0, 15.01)
"""What the desired force is larger in each cycle, N; the difference of the last two is too small to be drawn."""


def shift(table, **added):
    """A table some of whose columns are larger."""
    for name, more in added.items():
        values = pa.array(table[name].to_numpy() + more, table.schema.field(name).type)
        table = table.set_column(table.column_names.index(name), table.schema.field(name), values)
    return table


def make_traces(shifts=SHIFTS, loads=LOADS):
    """The traces of a robot over several cycles, and its manifest."""
    traces, manifest = make_robot_traces()
    clocks = [{"step": n * STEPS, "time": 0.1 * n * STEPS, "cycle": n} for n in range(len(shifts))]
    plans = [{"x_desired": x, "force_desired": load} for x, load in zip(shifts, loads, strict=True)]
    legs = [shift(traces.legs, **clock, **plan) for clock, plan in zip(clocks, plans, strict=True)]
    body = [shift(traces.body, **clock) for clock in clocks]
    return Traces(pa.concat_tables(legs), pa.concat_tables(body)), manifest | {"steps": len(shifts) * STEPS}


def make_data(*moves):
    """The same as figures read it."""
    table = make_traces(*moves)[0].legs
    rows = {name: table[name].to_numpy() for name in table.column_names if name != "phase"}
    rows["phase"] = np.array(table["phase"].to_pylist()) == "support"
    cycles = np.unique(rows["cycle"]).tolist()
    return CycleData(cycles, rows, None, 0.1 * STEPS, 0.1, LEGS, True, "xyz")


def find_plans(panel):
    return {series.name: series for series in panel.series if series.name.startswith("desired")}


def test_each_cycle_has_its_own_desired_path_and_force():
    data = make_data()
    for leg, panel in zip(LEGS, over_cycle(data, "foot", LEGS), strict=True):
        plans = find_plans(panel)
        assert list(plans) == ["desired, cycle 1", "desired, cycles 2, 3"]
        for cycle, plan in zip((1, 3), plans.values(), strict=True):
            assert_allclose(plan.x, 1e3 * data.select(cycle, leg)["x_desired"])
            assert_allclose(plan.y, 1e3 * data.select(cycle, leg)["y_desired"])
        lines = {series.name: series.style["color"] for series in panel.series}
        assert lines["desired, cycle 1"] == pale(lines["cycle 1"])
        assert lines["desired, cycles 2, 3"] == pale(lines["cycle 3"])
    for leg, panel in zip(LEGS, over_cycle(data, "force", LEGS), strict=True):
        last = find_plans(panel)["desired, cycles 2, 3"]
        assert_allclose(last.y, data.select(3, leg)["force_desired"])


def test_a_plan_that_stays_is_one_grey_line_and_needs_no_words():
    data = make_data((0.0, 0.0), (0.0, 0.01))
    for panel in over_cycle(data, "force", LEGS):
        (line,) = find_plans(panel).values()
        assert (line.name, line.style) == ("desired", DESIRED_LINE)
    assert not any("lines are pale" in drawing.caption for drawing in draw_tracking(data))
    moved = {drawing.name: drawing.caption for drawing in draw_tracking(make_data())}
    assert {name for name, caption in moved.items() if "lines are pale" in caption} == {"foot", "force"}


def test_a_plan_that_moves_under_one_leg_is_drawn_so_under_all():
    data = make_data((0.0, 0.0), (0.0, 0.0))
    data.trace["x_desired"] = data.trace["x_desired"] + 0.01 * ((data.trace["leg"] == 3) & (data.trace["cycle"] == 2))
    for panel in over_cycle(data, "foot", LEGS):
        assert list(find_plans(panel)) == ["desired, cycle 1", "desired, cycle 2"]


def test_a_pale_colour_is_lighter():
    assert (pale("#000000"), pale("#FF7D00"), pale("#FFFFFF")) == ("#999999", "#FFCB99", "#FFFFFF")


def test_the_desired_path_of_a_recording_follows_the_cycle_at_the_cursor(tmp_path):
    traces, manifest = make_traces()
    view = make_view(traces, manifest)
    recording = rr.RecordingStream("test", recording_id="moving")
    memory = recording.memory_recording()
    log_machine(Entities(recording, view), view)
    path = tmp_path / "moving.rrd"
    path.write_bytes(memory.drain_as_bytes())
    chunks = RrdReader(path).stream().filter(content="/world/travel/body/path/desired").to_chunks()
    rows = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist() if row.get("step") is not None]
    assert [row["step"] for row in rows] == [0, STEPS, 2 * STEPS]
    for row in rows:
        shown = slice(row["step"], row["step"] + STEPS)
        for leg, strip in zip(view.legs, row["LineStrips3D:strips"], strict=True):
            assert_allclose(strip, leg.foot("_desired")[shown], atol=1e-6)
