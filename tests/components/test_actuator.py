"""The actuator by hand: late, limited, slow."""

import numpy as np
import pytest

from cmacexp.config.schema import ActuatorConfig
from cmacexp.control.actuator import actuate, new_actuator
from cmacexp.loop import roll_out
from cmacexp.loop.scenario import make_scenario


def act(feedback, feedforward, limit=np.inf, change=np.inf, delay=0, lag=0.0):
    """Feedback, feedforward and torque that act, (steps, 3), of those commanded to one joint."""
    actuator = new_actuator(ActuatorConfig(None, None, delay, lag), 1.0, 1, (limit, limit))._replace(change=change)
    rows = []
    for step, (back, forward) in enumerate(zip(feedback, feedforward, strict=True)):
        parts = [np.array([[value, 0.0]]) for value in (back, forward, 0.0)]
        actuate(actuator, step, *parts)
        rows.append([part[0, 0] for part in parts])
    return np.array(rows).T.tolist()


def test_an_ideal_actuator_gives_what_is_commanded():
    assert act([1, 2], [10, 20]) == [[1, 2], [10, 20], [11, 22]]


def test_a_late_one_gives_nothing_before_the_first_command_arrives():
    assert act([1, 2, 3, 4], [10, 20, 30, 40], delay=2) == [[0, 0, 1, 2], [0, 0, 10, 20], [0, 0, 11, 22]]


def test_a_slow_one_changes_by_so_much_a_step_and_the_feedback_gives_way():
    assert act([0, 0, 0, 0], [2, 9, 9, -9], change=4) == [[0, -3, 0, 14], [2, 9, 9, -9], [2, 6, 9, 5]]


def test_the_rate_is_held_after_the_limit():
    assert act([9, 9, 9], [0, 0, 0], limit=5, change=3)[2] == [3, 5, 5]


def test_one_with_a_lag_goes_half_of_the_way_in_each_step_after_the_limit():
    halving = 1.0 / np.log(2.0)
    assert act([9, 9, 9], [4, 4, 4], limit=12, lag=halving) == pytest.approx(
        np.array([[4, 6, 7], [2, 3, 3.5], [6, 9, 10.5]])
    )


@pytest.mark.parametrize("delay", [1, 3])
def test_the_torque_commanded_at_a_step_acts_so_many_steps_later(make_config, delay):
    late = roll_out(make_scenario(make_config("cycles=1", f"actuator.delay={delay}"))).columns()
    first = roll_out(make_scenario(make_config("cycles=1"))).columns()
    for joint in ("1", "2"):
        torque = late[f"tau_feedback_{joint}"][:, 0]
        assert not torque[:delay].any()
        assert torque[delay] == first[f"tau_feedback_{joint}"][0, 0]
