"""What the link sends, within limits whatever is measured, and whom it hears; its robot is an object here."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmacexp.addons.unitree.guardian import make_damping, soften
from cmacexp.addons.unitree.link import Link
from cmacexp.addons.unitree.messages import LOW_STATE, get_motors, new_command, set_motors
from cmacexp.addons.unitree.states import LimitsConfig, StateWatch, Unsafe, read_state

LIMITS = LimitsConfig(
    silence=0.05, lost=1.0, tilt=0.5, speed=20.0, deviation=0.4, torque=20.0, stiffness=150.0, damping=10.0,
    temperature=75.0, voltage=0.0, overvoltage=34.0,
)  # fmt: skip
ANGLES = np.linspace(-0.3, 0.3, 12).reshape(4, 3)


class Wire:
    """A wire on which states lie ready, and on which others may send."""

    def __init__(self, states=(), other=None):
        self.states, self.other, self.sent = list(states), other, []

    def receive(self, timeout):
        return self.states.pop(0) if self.states else None

    def receive_other(self):
        return self.other

    def send(self, command):
        self.sent.append(command.copy())


def make_state(q):
    state = np.zeros((), LOW_STATE)
    state["imu_state"]["quaternion"] = [1.0, 0.0, 0.0, 0.0]
    set_joints = np.zeros(20)
    set_joints[[3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]] = q.ravel()
    state["motor_state"]["q"] = set_joints
    return state


def make_link(wire, q=ANGLES):
    """A link in the middle of a walk, by the parts that a step uses."""
    link = Link.__new__(Link)
    link.limits, link.period, link.wire = LIMITS, 0.0, wire
    link.guardian = SimpleNamespace(report=lambda command: None, runs=True)
    link.command, link.log = new_command(), None
    link._sent, link._alone_from = [], 0.0
    link.watch = StateWatch(LIMITS, (4, 3), 1)
    reading = read_state(make_state(q))
    link.signals = reading.signals
    link.commanded = q
    link.watch.check(reading, q)
    return link


numbers = st.floats(-0.7, 0.7)


@given(numbers, numbers, st.floats(-100, 100), st.floats(0.0, 150.0), st.floats(0.0, 10.0))
def test_neither_torque_nor_its_sum_with_the_feedback_passes_the_limit(angle, rate, torque, stiffness, damping):
    wire = Wire()
    link = make_link(wire)
    link.signals = link.signals._replace(dq=np.full((4, 3), rate))
    link.send(ANGLES + angle, 0.0, torque, stiffness, damping)
    motors = wire.sent[0]["motor_cmd"]
    q, dq, tau, kp, kd = (get_motors(motors[name]) for name in ("q", "dq", "tau", "kp", "kd"))
    assert np.abs(tau).max() <= LIMITS.torque
    assert np.abs(tau + kp * (q - ANGLES) + kd * (dq - rate)).max() <= LIMITS.torque + 1e-3


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ((ANGLES + 0.9, 0.0, 0.0, 90.0, 3.0), "beyond 2 times plant.limits.deviation=0.4"),
        ((ANGLES, 0.0, 0.0, 5000.0, 3.0), "a stiffness of 5e"),
        ((ANGLES, 0.0, 0.0, 90.0, 100.0), "a damping of 100 is above plant.limits.damping=10"),
        ((ANGLES, 0.0, np.nan, 90.0, 3.0), "not finite"),
    ],
)
def test_an_unsafe_command_is_not_sent(command, said):
    wire = Wire()
    with pytest.raises(Unsafe, match=said):
        make_link(wire).send(*command)
    assert not wire.sent


def test_a_state_that_leaps_counts_as_none():
    wrong = ANGLES + 0.5 * (np.arange(12).reshape(4, 3) == 4)
    link = make_link(Wire([make_state(wrong), make_state(wrong), make_state(ANGLES)]))
    link.arrived = np.inf  # no time passes
    link.receive()
    assert np.allclose(link.signals.q, ANGLES)
    link = make_link(Wire([make_state(wrong)] * 3))
    link.arrived = np.inf
    with pytest.raises(Unsafe, match=r"right front thigh leaps by 0\.5 rad"):
        link.receive()


def test_a_state_that_repeats_the_last_is_ignored_for_a_while():
    link = make_link(Wire([make_state(ANGLES), make_state(ANGLES + 0.01)]))
    link.period = 10.0
    link.receive()
    assert np.allclose(link.signals.q, ANGLES + 0.01)
    link = make_link(Wire([make_state(ANGLES)] * 2))
    link.period = -1.0  # it has been long
    link.receive()
    assert np.allclose(link.signals.q, ANGLES)


def test_another_sender_ends_a_walk_and_the_own_guardian_does_not():
    link = make_link(wire := Wire([make_state(ANGLES)] * 3))
    link.send(ANGLES, 0.0, 0.0, 90.0, 3.0)
    wire.other = soften(wire.sent[0], 3.0, 0.5)
    link.receive()
    wire.other = make_damping(3.0)
    with pytest.raises(Unsafe, match="somebody else sends commands"):
        link.receive()
    link._alone_from = np.inf  # it begins: the guardian of the run before may damp
    link.receive()


def test_a_command_is_softened_by_degrees_into_damping():
    command = new_command()
    set_motors(command, q=ANGLES, dq=1.0, tau=8.0, kp=80.0, kd=2.0)
    half, whole = (soften(command, 3.0, share)["motor_cmd"] for share in (0.5, 1.0))
    for motors, tau, kp, kd in ((half, 4.0, 40.0, 2.5), (whole, 0.0, 0.0, 3.0)):
        values = [get_motors(motors[name])[0, 0] for name in ("dq", "tau", "kp", "kd")]
        assert values == [0.0, tau, kp, kd]
        assert np.allclose(get_motors(motors["q"]), ANGLES)
