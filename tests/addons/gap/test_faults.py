"""Faults of a log: each gives one line that names it, and nothing is computed; a log without a fault is accepted."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.doors import BadInput
from support.logs import PERIOD, make_problem, simulate_log

from cmacexp.addons.gap.faults import check_against_model, check_log

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


def exchange(*keys):
    return lambda log: replace(log, **{key: getattr(log, key)[:, ::-1].copy() for key in keys})


FAULTS = {
    "short": (choose(lambda rows: rows[:150]), "has 150 rows"),
    "nan": (put([700], lambda own: np.nan), "q_hip is nan in row 700"),
    "huge": (put([700], lambda own: 1e300), r"q_hip is 1e\+300 in row 700"),
    "nan that is fed forward": (
        lambda log: replace(log, feedforward=np.where(log.time[:, None] == log.time[700], np.nan, log.feedforward)),
        "feedforward is nan in row 700",
    ),
    "no rotation": (
        lambda log: replace(log, orientation=np.zeros((len(log.time), 4))),
        "the norm 0 in row 0: must be 1",
    ),
    "time in ms": (change("time", None, 1e3), "the unit of time"),
    "repeated": (choose(lambda rows: np.insert(rows, 500, 500)), "row 501 is not later"),
    "unsorted": (choose(lambda rows: np.r_[rows[:500], 501, 500, rows[502:]]), "row 501 is not later"),
    "gap": (choose(lambda rows: np.delete(rows, [500, 501])), "lacks rows before row 500"),
    "lost and restamped": (choose(lambda rows: np.delete(rows, range(640, 643)), True), "rows were lost"),
    "joined": (choose(lambda rows: np.r_[rows[:300], rows[520:]], True), "the log was joined there"),
    "commands for angles": (lambda log: replace(log, angle=log.command), "hold the commands"),
    "degrees": (change("angle", None, DEGREES), "one of them is in degrees"),
    "all in degrees": (
        lambda log: change("command", None, DEGREES)(change("angle", None, DEGREES)(log)),
        "--units angle=deg,command=deg",
    ),
    "sign": (change("angle", 0, -1.0), "q_hip moves -0.895 times as far as q_des_hip"),
    "scale": (change("angle", 0, 2.0), "times as far as q_des_hip"),
    "zero": (change("angle", 0, 1.0, 0.5), "their zeros differ"),
    "joints exchanged": (exchange("angle"), "times as far as q_des_hip|are columns exchanged|zeros differ"),
    "frozen": (put(slice(400, 520), lambda own: own[0]), "frozen encoder"),
    "clipped": (put(slice(None), lambda own: np.minimum(own, 0.45)), "clipped at 0.45"),
    "outlier": (put([600], lambda own: own + 0.3), "jumps at row 600"),
    "at rest": (choose(lambda rows: rows[:210]), "identifies neither"),
    "torque": (lambda log: replace(log, torque=log.kp * (log.angle - log.command)), "what the gains give"),
    "late commands": (lambda log: replace(log, command=np.roll(log.command, -6, 0)), "are shifted"),
    "gains": (lambda log: replace(log, kp=3.0 * log.kp, kd=3.0 * log.kd), "gains .--kp., units of torque"),
    "gain kd": (lambda log: replace(log, kd=3.0 * log.kd), "--kd"),
}


def check(problem):
    check_log(problem.signals.log, problem.machine)
    return check_against_model(problem)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_a_log_gives_one_line_that_names_it(name):
    damage, words = FAULTS[name]
    problem = make_problem(damage(fine()))
    with pytest.raises(BadInput, match=words) as caught:
        check(problem)
    assert "\n" not in str(caught.value)


def test_a_log_without_a_fault_is_accepted_with_what_it_cannot_show():
    log = fine()
    assert any("no step of an encoder" in note for note in check(make_problem(log)))
    twins = replace(
        log, command=log.command[:, [0, 0]], angle=log.angle[:, [0, 0]], kp=log.kp[[0, 0]], kd=log.kd[[0, 0]]
    )
    assert "nothing in this log shows whether" in " ".join(check_against_model(make_problem(twins)))
