"""A plan that moves from cycle to cycle: figures draw of each cycle what was desired in it."""

import numpy as np
from numpy.testing import assert_allclose
from support.moving_plans import make_traces
from support.views import STEPS

from cmacexp.report.cycle_data import CycleData
from cmacexp.report.run_figures import over_cycle

LEGS = range(1, 5)


def make_data(shifts, loads):
    table = make_traces(shifts, loads)[0].legs
    rows = {name: table[name].to_numpy() for name in table.column_names if name != "phase"}
    rows["phase"] = np.array(table["phase"].to_pylist()) == "support"
    return CycleData(np.unique(rows["cycle"]).tolist(), rows, None, 0.1 * STEPS, 0.1, LEGS, True, "xyz")


def find_plans(data, name):
    """Desired lines by their names, of each leg."""
    panels = over_cycle(data, name, LEGS)
    return [{line.name: line for line in panel.series if line.name.startswith("desired")} for panel in panels]


def test_each_cycle_has_its_own_desired_path_and_force():
    """A difference of 0.01 N is too small to be drawn."""
    data = make_data((0.0, 0.01, 0.01), (0.0, 15.0, 15.01))
    for leg, path, force in zip(LEGS, find_plans(data, "foot"), find_plans(data, "force"), strict=True):
        assert list(path) == list(force) == ["desired, cycle 1", "desired, cycles 2, 3"]
        for cycle, line in zip((1, 3), path.values(), strict=True):
            assert_allclose(line.x, 1e3 * data.select(cycle, leg)["x_desired"])
            assert_allclose(line.y, 1e3 * data.select(cycle, leg)["y_desired"])
        assert_allclose(force["desired, cycles 2, 3"].y, data.select(3, leg)["force_desired"])


def test_a_plan_that_stays_is_one_line_and_one_that_moves_under_one_leg_is_drawn_so_under_all():
    data = make_data((0.0, 0.0), (0.0, 0.01))
    assert [list(lines) for lines in find_plans(data, "force") + find_plans(data, "foot")] == 8 * [["desired"]]
    data.trace["x_desired"] = data.trace["x_desired"] + 0.01 * ((data.trace["leg"] == 3) & (data.trace["cycle"] == 2))
    assert [list(lines) for lines in find_plans(data, "foot")] == 4 * [["desired, cycle 1", "desired, cycle 2"]]
