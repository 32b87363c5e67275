"""An interrupt of a run: it is heeded soon, and all steps that were taken are kept."""

import os
import signal

import pytest
from support.doors import make_scenario, roll_out

from cmacexp.loop import driver
from cmacexp.loop import run as loop

SHORT = ("cycles=2", "gait.cycle_time=0.5", "gait.stroke=0.02", "learning.start_cycle=1")


@pytest.mark.parametrize("feedforward", ["cmac", "ilc"])
def test_steps_give_the_same_bits_in_any_number_of_calls(make_config, monkeypatch, feedforward):
    config = make_config(*SHORT, f"feedforward={feedforward}")
    expected = roll_out(make_scenario(config))
    monkeypatch.setattr(loop, "LONGEST_CALL", 0.0)  # a step a call
    assert roll_out(make_scenario(config)).samples.tobytes() == expected.samples.tobytes()


def test_an_interrupt_is_heeded_within_a_cycle_and_all_steps_are_kept(make_config, monkeypatch):
    config = make_config(*SHORT)
    expected = roll_out(make_scenario(config))
    whole, calls = driver.step_loop, []

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) == 131:  # the first takes no step
            os.kill(os.getpid(), signal.SIGINT)
        return whole(*arguments)

    monkeypatch.setattr(driver, "step_loop", interrupted)
    monkeypatch.setattr(loop, "LONGEST_CALL", 0.0)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    rollout = roll_out(make_scenario(config))
    signal.signal(signal.SIGINT, before)
    assert (rollout.status, rollout.cause, rollout.steps) == ("interrupted", "after step 130", 130)
    assert rollout.samples.tobytes() == expected.samples[:130].tobytes()
