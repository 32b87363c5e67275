"""What a robot measures against the limits: each fault stops a run, and says which limit."""

import dataclasses

import numpy as np
import pytest

from cmacexp.addons.unitree.faults import KINDS, NO_FAULT, Fault
from cmacexp.addons.unitree.messages import LOW_STATE, new_command
from cmacexp.addons.unitree.states import FAST, LimitsConfig, StateWatch, Unsafe, read_state
from cmacexp.errors import BadInput

LIMITS = LimitsConfig(
    silence=1.0, lost=0.02, tilt=0.5, speed=20.0, deviation=0.4, torque=20.0, stiffness=150.0, damping=10.0,
    temperature=75.0, voltage=22.0, overvoltage=34.0,
)  # fmt: skip
SEEN = {
    "lost_states": "lost", "lost_commands": "lost", "frozen": "frozen", "frozen_numbers": "stuck",
    "nan": "not finite", "stuck": "right front hip is stuck", "sign_of_encoder": "from its command",
    "sign": "from its command",
    "swapped": "from its command", "swapped_encoders": "from its command", "hot": "temperature", "empty": "voltage",
    "remote": "remote control", "other": "overvoltage",
}  # fmt: skip
"""What is said of each fault."""
HELD = {"late", "stall", "leap"}
"""Faults during which the guardian holds the robot."""


def watch_motion(fault, steps=1500, limits=LIMITS, tick=1):
    """Watch joints that follow their commands exactly, each leg elsewhere, under a fault."""
    watch, state = StateWatch(limits, (4, 3), 1), np.zeros((), LOW_STATE)
    state["imu_state"]["quaternion"], state["power_v"] = [1.0, 0.0, 0.0, 0.0], 28.0
    for step in range(steps):
        asked = 0.5 + 0.5 * np.arange(4)[:, None] + 0.3 * np.sin(0.02 * step) * np.ones((4, 3))
        state["motor_state"]["q"][:12] = asked[[1, 0, 3, 2]].ravel()
        state["tick"] = tick * step
        fault.spoil_command(new_command(), step)
        if (sent := fault.spoil_state(state, step)) is not None:
            watch.check(read_state(sent), asked)
    return watch


@pytest.mark.parametrize(("lost", "tick"), [(LIMITS.lost, 1), (1.0, 0)])
def test_a_robot_without_a_fault_passes_and_one_that_does_not_count_its_states_if_all_may_be_lost(lost, tick):
    assert watch_motion(Fault(), limits=dataclasses.replace(LIMITS, lost=lost), tick=tick).missed == 0


@pytest.mark.parametrize("kind", SEEN)
def test_every_fault_is_seen(kind):
    with pytest.raises(Unsafe, match=SEEN[kind]):
        watch_motion(Fault(kind, start=600, motor=0))


def test_all_kinds_of_faults_are_tried_and_others_are_refused():
    assert set(KINDS) == {NO_FAULT, *HELD, *SEEN}
    with pytest.raises(BadInput, match="did you mean stuck"):
        Fault("stuk")


def test_a_robot_that_tilts_is_fast_or_does_not_know_its_attitude_stops():
    lost = read_state(np.zeros((), LOW_STATE))._replace(voltage=28.0)
    level = lost.signals._replace(attitude=np.zeros(3))
    tilted = lost._replace(signals=level._replace(attitude=np.array([0.0, -0.6, 0.0])))
    fast = lost._replace(signals=level._replace(dq=np.full((4, 3), -41.0)))
    for other, said in ((tilted, "limits.tilt="), (fast, "limits.speed="), (lost, "no attitude")):
        with pytest.raises(Unsafe, match=said):
            StateWatch(LIMITS, (4, 3), 1).check(other, other.signals.q)


def make_reading(q, dq):
    reading = read_state(np.zeros((), LOW_STATE))._replace(voltage=28.0)
    signals = reading.signals._replace(q=np.full((4, 3), q), dq=np.full((4, 3), dq), attitude=np.zeros(3))
    return reading._replace(signals=signals)


@pytest.mark.parametrize(
    ("angle", "rate", "elapsed", "leaps"),
    [
        (0.05, 5.0, 0.01, False),  # moved as its velocity says
        (0.01, 5.0, 0.1, False),  # a simulator stood still for nearly all of that time
        (0.5, 5.0, 0.1, False),  # and here it did not
        (0.5, 0.0, 0.002, True),
        (-0.5, 5.0, 0.02, True),
        (0.65, 5.0, 0.1, True),
    ],
)
def test_an_angle_that_no_velocity_explains_leaps(angle, rate, elapsed, leaps):
    watch = StateWatch(LIMITS, (4, 3), 1)
    assert watch.find_leap(make_reading(angle, rate), elapsed, 0.002) == ""  # nothing to compare with
    watch.check(make_reading(0.0, rate), np.zeros((4, 3)))
    assert ("leaps by" in watch.find_leap(make_reading(angle, rate), elapsed, 0.002)) == leaps


def test_a_speed_above_its_limit_may_last_for_a_few_states():
    watch, tick = StateWatch(LIMITS, (4, 3), 1), iter(range(100))

    def check(rate):
        reading = make_reading(0.1 * next(tick), rate)
        signals = reading.signals._replace(tick=np.array([float(next(tick))]))
        watch.check(reading._replace(signals=signals), signals.q)

    for rate in (0.0, 30.0, 30.0, 0.0, *[30.0] * (FAST - 1)):
        check(rate)
    with pytest.raises(Unsafe, match=r"speed of 30 rad/s"):
        check(30.0)
