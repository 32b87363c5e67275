"""A robot that hangs: a leg learns the torque of its drives, within a limit, and gains rise before it is let down."""

from types import SimpleNamespace

import numpy as np
import pytest

from cmacexp.addons.unitree.hung import MOST_LEARNT, learn_strokes, make_memory, wait_for_ground
from cmacexp.addons.unitree.link import RAMP

pytestmark = pytest.mark.ci
STAND = np.array([[0.0, 0.8, -1.6]] * 4)


class Joints:
    """A link to joints with rotors, viscous friction and, in N m, a constant ``load``."""

    period = 0.002

    def __init__(self, load):
        self.load, self.sent = load, []
        self.signals = SimpleNamespace(q=STAND.copy(), dq=np.zeros_like(STAND))

    def move(self, goal, duration, gains):
        assert (goal == STAND).all()

    def send(self, angle, velocity, torque, stiffness, damping):
        state = self.signals
        self.sent.append(torque)
        self.torque = (
            torque + stiffness * (angle - state.q) + damping * (velocity - state.dq) - 0.3 * state.dq - self.load
        )

    def receive(self):
        self.signals.dq += self.torque / 0.02 * self.period
        self.signals.q += self.signals.dq * self.period


def test_a_leg_learns_up_to_a_limit_and_the_others_hold_still():
    link, loaded = Joints(load=0.5), Joints(load=9.0)
    first, *_, last = learn_strokes(link, STAND, 2, make_memory(), lead=1, rate=0.1)
    assert (last < 0.1 * first).all()
    assert not np.delete(link.sent, 2, axis=1).any()
    learn_strokes(loaded, STAND, 0, make_memory(), lead=1, rate=0.1)
    assert np.abs(loaded.sent).max() == MOST_LEARNT


def test_gains_rise_before_the_robot_is_let_down():
    durations = []
    link = SimpleNamespace(period=0.1, signals=None, move=lambda goal, duration, gains: durations.append(duration))
    wait_for_ground(link, STAND, (90.0, 5.0), lambda signals: 80.0, weight=100.0, longest=60.0)
    assert durations[0] >= RAMP
    assert durations[1:] == [link.period] * 10
