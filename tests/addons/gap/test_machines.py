"""Logs with measured torques of four kinds of simulated machines: the truth lies in the intervals."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from support.doors import BadInput
from support.machines import KINDS, make_machines

from cmacexp.addons.gap.analysis import measure
from cmacexp.addons.gap.identify import LEVELS, fit
from cmacexp.addons.gap.log import Log
from cmacexp.addons.gap.machine import read_machine
from cmacexp.addons.gap.problem import NAMES, Problem
from cmacexp.addons.gap.reading import read_log
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


SLIDE = """<mujoco><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
<geom type="box" size=".1 .1 .1" mass="8"/></body></worldbody></mujoco>"""


def write_slide(folder):
    """A log of 10 kg with 20 N s/m and 3 N, whose drive computes ten times a row; its model has 8 kg."""
    period, parts = 0.002, 10
    time = np.arange(0.0, 24.0, period)
    phase = 0.5 * np.pi * time
    command = 0.1 * (1.0 - np.cos(phase)) + 0.02 * np.sin(3.0 * phase)
    q, v, rows = float(command[0]), 0.0, []
    for target in command.tolist():
        rows.append((round(q, 5), target, 4000.0 * (target - q) - 80.0 * v))
        for _ in range(parts):
            v += (4000.0 * (target - q) - 100.0 * v - 3.0 * np.tanh(1e3 * v)) / 10.0 * period / parts
            q += v * period / parts
    columns = ["q_slide", "q_des_slide", "tau_slide"]
    pd.DataFrame(rows, columns=columns).assign(time=time).to_csv(folder / "slide.csv", index=False)
    (folder / "slide.xml").write_text(SLIDE)


@pytest.mark.ci
@pytest.mark.parametrize("is_measured", [True, False])
def test_an_interval_counts_that_a_drive_may_compute_between_rows(is_measured, tmp_path, compiled):
    write_slide(tmp_path)
    log = read_log(tmp_path / "slide.csv", gains={"kp": [4000.0], "kd": [80.0]})
    log = log if is_measured else replace(log, torque=None)
    problem = Problem(Signals(log), read_machine(str(tmp_path / "slide.xml"), log.joints))
    fitted = fit(problem, LEVELS[0], np.ones(len(log.time), dtype=bool))
    apart = np.abs(fitted.values[0, :2] - [2.0, 20.0]) / fitted.deviation[0, :2]
    assert (apart < 1.96).all()


ARM = """<robot name="arm"><link name="stand"/><link name="link"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="stand"/><child link="link"/><axis xyz="1 0 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>"""


@pytest.mark.ci
def test_an_arm_on_a_stand_without_mass_is_read(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    machine = read_machine(str(tmp_path / "arm.urdf"), ["0"])
    angle = np.array([[0.5 * np.pi]])
    torque = machine.compute_torque(angle, 0.0 * angle, 0.0 * angle)
    np.testing.assert_allclose(torque, [[2.0 * 9.81 * 0.5]])


TWO_LINKS = """<mujoco><worldbody><body>BASE<inertial pos="0 0 0" mass="5" diaginertia=".1 .1 .1"/>
<body><joint name="a" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="2"/>
<body pos="0 0 -.4"><joint name="b" axis="1 0 0"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1"/>
</body></body></body></worldbody></mujoco>"""


@pytest.mark.ci
@pytest.mark.parametrize("is_fixed", [True, False])
def test_a_base_that_leans_is_named_and_given(is_fixed, tmp_path):
    """Two links swing about axes at right angles; the log is that of a base turned by 70 and 20 degrees."""
    (tmp_path / "model.xml").write_text(TWO_LINKS.replace("BASE", "" if is_fixed else "<freejoint/>"))
    machine = read_machine(str(tmp_path / "model.xml"), ["a", "b"])
    time = np.arange(0.0, 20.0, 0.005)
    angle = np.stack([np.sin(2.0 * time), 0.7 * np.sin(3.1 * time)], axis=1)
    log = Log(tmp_path, time, ("a", "b"), angle, None, 0.0 * angle, None, 0.0 * angle, *np.full((2, 2), np.nan), None)
    leaning = log.lean(*np.radians([70.0, 20.0]))
    problem = Problem(Signals(leaning), machine)
    log = replace(log, torque=problem.rigid + 0.1 * np.sign(problem.signals.velocity))
    with pytest.raises(BadInput, match=r"base that leans by 70 degrees about x and 20 about y.*--lean 70.0,20.0"):
        measure(log, machine)
    assert measure(log.lean(*np.radians([70.0, 20.0])), machine).values["explained"]["all"]["model"] < 30.0
