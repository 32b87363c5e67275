"""Faults of a log: each gives one line that names it, and nothing is computed; a log without a fault is accepted."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.doors import BadInput
from support.logs import PERIOD, make_problem, simulate_log

from cmacexp.addons.gap.analysis import measure
from cmacexp.addons.gap.faults import KINDS, check
from cmacexp.addons.gap.regression import fit_model

fine = cache(simulate_log)
DEGREES = 180.0 / np.pi


def change(key, column=None, factor=1.0, offset=0.0):
    """One signal, or one column of it, times a factor, and an offset."""

    def damage(log):
        values = getattr(log, key).copy()
        values[..., slice(None) if column is None else column] *= factor
        values[..., slice(None) if column is None else column] += offset
        return replace(log, **{key: values})

    return damage


def put(rows, values):
    """Other values in rows of the hip's angle; ``values`` gets those that were there."""

    def damage(log):
        angle = log.angle.copy()
        angle[rows, 0] = values(angle[rows, 0])
        return replace(log, angle=angle)

    return damage


def choose(rows, restamp=False):
    """Some rows in another order or number, perhaps with the times written anew."""

    def damage(log):
        chosen = rows(np.arange(len(log.time)))
        cut = {key: getattr(log, key)[chosen] for key in ("angle", "command", "command_velocity", "feedforward")}
        return replace(log, time=np.arange(len(chosen)) * PERIOD if restamp else log.time[chosen], **cut)

    return damage


def with_torque_alone(log):
    """A log with the torques that its gains give, instead of these."""
    torque = log.kp * (log.command - log.angle) - log.kd * np.gradient(log.angle, PERIOD, axis=0)
    return replace(log, torque=torque, kp=np.full(2, np.nan), kd=np.full(2, np.nan))


def exchange(*keys):
    return lambda log: replace(log, **{key: getattr(log, key)[:, ::-1].copy() for key in keys})


def with_velocity(rate):
    """A log with measured velocities, whose times are those of another ``rate``."""

    def damage(log):
        velocity = np.gradient(log.angle, PERIOD, axis=0)
        return replace(log, velocity=velocity, time=np.arange(len(log.time)) / rate)

    return damage


FAULTS = {
    "short": (choose(lambda rows: rows[:150]), "has 150 rows"),
    "huge": (put([700, 701], lambda own: 1e300), r"q_hip is 1e\+300 in row 700"),
    "nan for long": (put(range(700, 720), lambda own: np.nan), "q_hip is nan in row 700 and 19 others"),
    "no rotation": (
        lambda log: replace(log, orientation=np.zeros((len(log.time), 4))),
        "the norm 0 in row 0: must be 1",
    ),
    "time in ms": (change("time", None, 1e3), "the unit of time"),
    "lost and restamped": (choose(lambda rows: np.delete(rows, range(640, 643)), True), "rows were lost"),
    "joined": (choose(lambda rows: np.r_[rows[:300], rows[520:]], True), "the log was joined there"),
    "commands for angles": (lambda log: replace(log, angle=log.command), "hold the angles: they are no"),
    "angles for commands": (
        lambda log: replace(log, command=np.roll(log.angle, -1, 0)),
        "hold the angles of the next row",
    ),
    "no order": (
        choose(lambda rows: np.random.default_rng(0).permutation(rows), True),
        "rows are no samples in order",
    ),
    "degrees": (change("angle", None, DEGREES), "one of them is in degrees"),
    "all in degrees": (
        lambda log: change("command", None, DEGREES)(change("angle", None, DEGREES)(log)),
        "--units angle=deg,command=deg",
    ),
    "all in degrees, and no gains": (
        lambda log: change("command", None, DEGREES)(change("angle", None, DEGREES)(with_torque_alone(log))),
        "--units angle=deg,command=deg",
    ),
    "sign": (change("angle", 0, -1.0), "q_hip moves -0.895 times as far as q_des_hip"),
    "scale": (change("angle", 0, 2.0), "times as far as q_des_hip"),
    "zero": (change("angle", 0, 1.0, 0.5), "their zeros differ"),
    "joints exchanged": (exchange("angle"), "times as far as q_des_hip|are columns exchanged|zeros differ"),
    "frozen": (put(slice(400, 520), lambda own: own[0]), "frozen encoder"),
    "clipped": (put(slice(None), lambda own: np.minimum(own, 0.45)), "clipped at 0.45"),
    "outlier": (put([600, 601], lambda own: own + 0.3), "jumps at row"),
    "at rest": (change("angle", None, 0.0), "identifies neither.*of all joints: take a longer log"),
    "torque": (lambda log: replace(log, torque=log.kp * (log.angle - log.command)), "what the gains give"),
    "rate": (with_velocity(200.0), "measured velocities are 0.5 times .* --rate 99.96"),
    "magnitudes": (
        lambda log: replace(with_torque_alone(log), torque=np.abs(with_torque_alone(log).torque)),
        "magnitudes",
    ),
    "late commands": (lambda log: replace(log, command=np.roll(log.command, -6, 0)), "are shifted"),
    "gains": (lambda log: replace(log, kp=3.0 * log.kp, kd=3.0 * log.kd), "gains .--kp., units of torque"),
    "gain kd": (lambda log: replace(log, kd=3.0 * log.kd), "--kd"),
}


def check_alone(log):
    problem = make_problem(log)
    return check(problem, fit_model(problem))


def notes_of(log, accepted=()):
    return measure(log, make_problem(log).machine, accepted).values["notes"]


def jitter(log):
    """The log with a host's stamps: 2 to 18 ms apart, of samples that were taken evenly."""
    steps = np.random.default_rng(0).uniform(0.2, 1.8, len(log.time)) * PERIOD
    return replace(log, time=np.cumsum(steps) + 1.7e9)


MENDED = {
    "nan": (put([700], lambda own: np.nan), "q_hip: 1 missing values were interpolated, first in row 700"),
    "nan that is fed forward": (
        lambda log: replace(log, feedforward=np.where(log.time[:, None] == log.time[700], np.nan, log.feedforward)),
        "1 missing values",
    ),
    "repeated": (choose(lambda rows: np.insert(rows, 500, 500)), "1 rows with the time of the row before them"),
    "unsorted": (choose(lambda rows: np.r_[rows[:500], 501, 500, rows[502:]]), "sorted by time"),
    "gap": (choose(lambda rows: np.delete(rows, [500, 501])), "resampled every"),
    "hole": (choose(lambda rows: np.delete(rows, range(900, 1000))), "the longest piece is used, 0.000 to 8.990 s"),
    "outlier": (put([600], lambda own: own + 0.3), "q_hip: 1 values apart .* first in row 600"),
    "turns": (lambda log: replace(log, angle=log.angle + 2.0 * np.pi * (log.time[:, None] > 5.0)), "unwrapped"),
    "jitter": (jitter, "times jitter, not the samples"),
}


@pytest.mark.parametrize("name", MENDED)
def test_a_fault_of_the_clock_is_mended_and_noted(name):
    damage, words = MENDED[name]
    assert re.search(words, " ".join(notes_of(damage(fine()))))


def test_all_faults_are_in_one_line_with_the_options_that_go_on_and_one_that_is_accepted_is_a_note():
    log = put([600, 601], lambda own: own + 0.3)(fine())
    log = replace(log, angle=np.column_stack([log.angle[:, 0], np.full(len(log.time), 0.1)]))
    with pytest.raises(
        BadInput, match=r"jumps at row 601.*joint knee moves 0 rad.*--accept scale,jump --leave-out knee"
    ):
        notes_of(log)
    late = replace(fine(), command=np.roll(fine().command, -6, 0))
    assert any("Accepted (delay)" in note for note in notes_of(late, ("delay", "damping", "gravity", "model")))


def test_rows_around_missing_ones_stay_as_they_are():
    log = choose(lambda rows: np.delete(rows, [500, 501]))(fine())
    mended = measure(log, make_problem(log).machine).signals.log
    np.testing.assert_allclose(mended.time, fine().time, atol=1e-9)
    np.testing.assert_allclose(np.delete(mended.angle, [500, 501], 0), log.angle, atol=1e-9)


def test_degrees_of_a_joint_without_limits_are_a_fault_of_its_unit():
    log = FAULTS["all in degrees"][0](fine())
    machine = make_problem(log).machine
    free = replace(machine, ranges=np.full_like(machine.ranges, np.inf) * [-1.0, 1.0])
    with pytest.raises(BadInput, match="--units angle=deg,command=deg"):
        measure(log, free)


def test_a_measured_torque_of_one_joint_in_another_unit_is_a_fault_and_its_factor_is_estimated():
    log = replace(fine(), torque=make_problem(fine()).signals.torque * [1.0, 7.0], command=None)
    with pytest.raises(BadInput, match=r"torque of knee is .* times .*--units torque=unknown"):
        notes_of(log)
    scaled = measure(replace(log, is_unit_known=False), make_problem(log).machine)
    assert scaled.signals.log.is_unit_known
    assert any("N m for each unit" in note for note in scaled.values["notes"])
    assert scaled.values["explained"]["all"]["identified on the first half"] < 30.0


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_a_log_gives_one_line_that_names_it(name):
    damage, words = FAULTS[name]
    with pytest.raises(BadInput, match=words) as caught:
        notes_of(damage(fine()))
    assert "\n" not in str(caught.value)


def test_commands_that_do_not_agree_are_not_used_beside_measured_torques():
    log = change("command", None, 0.02)(with_torque_alone(fine()))
    assert "Commands are not used, since torques are logged" in " ".join(notes_of(log))


def test_a_joint_that_sticks_while_its_command_moves_is_no_frozen_encoder():
    log = fine()
    angle = log.angle.copy()
    stuck = angle[400:520, 0]
    angle[:, 0] += np.cumsum(np.r_[np.zeros(400), -np.diff(stuck, prepend=stuck[0]), np.zeros(len(angle) - 520)])
    assert not any("frozen encoder" in note for note in notes_of(replace(log, angle=angle), KINDS))
    assert any("frozen encoder" in note for note in notes_of(FAULTS["frozen"][0](log), KINDS))


def test_a_factor_of_bodies_much_lighter_than_friction_is_no_fault_of_a_sign():
    log = with_torque_alone(fine())
    log = replace(log, torque=log.torque + 50.0 * np.sign(np.gradient(log.angle, PERIOD, axis=0)))
    regression = fit_model(make_problem(log))
    assert not regression.differs.any()
    reverse = fit_model(make_problem(replace(log, torque=-with_torque_alone(fine()).torque)))
    assert reverse.differs.all()


def test_a_slow_move_of_an_encoder_with_coarse_steps_is_no_loss_of_rows():
    log = fine()
    ramp = np.minimum(np.arange(len(log.time)) / 3.0, 4.0)[:, None]
    moved = replace(log, angle=0.004 * np.round(ramp) + np.zeros(2), command=0.004 * ramp + np.zeros(2))
    assert not any("rows were lost" in note for note in notes_of(moved, KINDS))


def test_a_log_without_a_fault_is_accepted_with_what_it_cannot_show():
    log = fine()
    assert any("no step of an encoder" in note for note in notes_of(log))
    twins = replace(
        log, command=log.command[:, [0, 0]], angle=log.angle[:, [0, 0]], kp=log.kp[[0, 0]], kd=log.kd[[0, 0]]
    )
    assert "nothing in this log shows whether" in " ".join(check_alone(twins))
