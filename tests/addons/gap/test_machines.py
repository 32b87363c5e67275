"""Logs with measured torques of four kinds of simulated machines: the truth lies in the intervals."""

from dataclasses import replace

import numpy as np
import pytest
from support.doors import BadInput
from support.machines import KINDS, make_machines

from cmacexp.addons.gap.analysis import measure
from cmacexp.addons.gap.identify import LEVELS, fit
from cmacexp.addons.gap.machine import read_machine
from cmacexp.addons.gap.problem import NAMES, Problem
from cmacexp.addons.gap.signals import Signals
from cmacexp.addons.gap.validation import compare_fits, rows_of

LEVEL = {"axis": 1, "arm": 1, "leg": 2, "belt": 1}
"""Model of joints of each kind: with an offset, and with friction over the angle."""


def list_inside(kind, count, folder, first=0):
    """For each interval that is given, true if it contains the truth."""
    inside = []
    for machine in make_machines(kind, count, first):
        (folder / "model.xml").write_text(machine.model)
        problem = Problem(Signals(machine.log), read_machine(str(folder / "model.xml"), machine.log.joints))
        level, strokes = LEVELS[LEVEL[kind]], problem.signals.count
        spans = ((1, strokes), (1, 2 * strokes // 3), (2 * strokes // 3 + 1, strokes))
        whole, forward, reverse = (fit(problem, level, rows_of(problem.signals, *span)) for span in spans)
        withheld = set(compare_fits(problem, forward, reverse))
        truth = np.zeros_like(whole.values)
        truth[:, :3] = machine.truth * [1.0, 1.0, -1.0]
        knots = np.linspace(*problem.ranges, level.knots) if level.knots > 1 else np.zeros((1, len(truth)))
        truth[:, len(NAMES) :] = [np.polyval(machine.friction[j], knots[:, j]) for j in range(len(truth))]
        apart = np.abs(whole.values - truth) / np.maximum(whole.deviation, 1e-12)
        for j, joint in enumerate(machine.log.joints):
            for k, name in enumerate(("rotor_inertia", "viscous_friction", "offset")):
                inside += [apart[j, k] < 1.96] * ((joint, name) not in withheld)
            inside += (apart[j, len(NAMES) :] < 1.96).tolist() * ((joint, "coulomb_friction") not in withheld)
    return inside


@pytest.mark.ci
@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_of_a_machine_lies_in_its_intervals(kind, tmp_path, compiled):
    assert np.mean(list_inside(kind, 1, tmp_path)) >= 0.75


@pytest.mark.ci
def test_the_gains_of_a_soft_leg_with_friction_over_the_angle_are_not_refused(tmp_path, compiled):
    machine = next(make_machines("leg", 1, 5))
    (tmp_path / "model.xml").write_text(machine.model)
    log = replace(machine.log, torque=None, kp=np.full(2, 25.0), kd=np.full(2, 1.0))
    robot = read_machine(str(tmp_path / "model.xml"), log.joints)
    assert measure(log, robot).values["explained"]["all"]["identified on the first half"] < 20.0
    with pytest.raises(BadInput, match="--kd 3 is too large"):
        measure(replace(log, kd=3.0 * log.kd), robot)


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_intervals_contain_the_truth_in_93_percent_of_25_machines(kind, tmp_path, compiled):
    inside = list_inside(kind, 25, tmp_path)
    assert len(inside) > 60
    assert np.mean(inside) >= 0.93
