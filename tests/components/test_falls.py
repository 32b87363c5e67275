"""When a machine falls or diverges, and how that is reported."""

import numpy as np
import pytest
from support.rollout import roll_out
from support.walks import PERIOD

from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.stop import (
    DIVERGED,
    FELL,
    LONGEST_UNSTABLE,
    LOWEST_HIP,
    RUNNING,
    STEEPEST,
    describe_stop,
    new_limits,
    stop_reason,
)
from cmacexp.planning.machine import make_mechanism
from cmacexp.plants.protocol import new_measurement

AT_REST = np.zeros((4, 2))


@pytest.fixture
def limits(make_config):
    """A limits whose planned margin is negative in the first hundred samples."""
    mechanism = make_mechanism(make_config("scenario=quadruped").machine)
    return new_limits(mechanism, np.r_[np.full(100, -1e-3), np.full(400, 0.02), np.full(100, np.nan)], PERIOD)


def stop_at(limits, body, sample=300, q=AT_REST, dq=AT_REST, force=None):
    """Why a machine stops in this state, and in words."""
    force = np.full(4, 10.0) if force is None else np.asarray(force)
    state = new_measurement(4)._replace(q=q, dq=dq, force=force, body=np.array(body, dtype=float))
    status = stop_reason(limits, sample, state)
    return status, describe_stop(limits, status, 200, PERIOD, state) if status != RUNNING else ""


FALLS = {
    "the body has no static equilibrium": (np.nan, 0.0, 0.0),
    "pitch 0.510 rad, beyond 0.5 rad": (0.5, 0.51, 0.0),
    "pitch -0.510 rad, beyond 0.5 rad": (0.5, -0.51, 0.3),
    "roll 0.510 rad, beyond 0.5 rad": (0.5, 0.3, 0.51),
    "roll -0.510 rad, beyond 0.5 rad": (0.5, 0.0, -0.51),
    "hip of leg 1 at 0.240 m, below 0.25 m": (0.24, 0.0, 0.0),
    "hip of leg 2 at 0.246 m, below 0.25 m": (0.3, 0.1, 0.14),  # down in front and on the right
    "hip of leg 3 at 0.222 m, below 0.25 m": (0.3, -0.2, -0.15),
}


@pytest.mark.parametrize("cause", FALLS)
def test_a_fall_is_named_with_step_time_and_cause(limits, cause):
    assert stop_at(limits, FALLS[cause]) == (FELL, f"at step 200 (t = 1.000 s): {cause}")


@pytest.mark.parametrize(
    "body",
    [(0.5, STEEPEST, 0.0), (0.5, 0.0, -STEEPEST), (LOWEST_HIP, 0.0, 0.0), (0.55, 0.3, -0.3)],
)
def test_up_to_its_limits_a_body_has_not_fallen(limits, body):
    assert stop_at(limits, body) == (RUNNING, "")


def test_a_negative_margin_is_a_fall_when_it_lasts_longer_than_a_quarter_of_a_second(limits):
    longest = round(LONGEST_UNSTABLE / PERIOD)
    reasons = [stop_at(limits, (0.5, 0.0, 0.0), sample=k) for k in range(longest + 1)]
    assert reasons[:-1] == [(RUNNING, "")] * longest
    assert reasons[-1] == (FELL, "at step 200 (t = 1.000 s): planned stability margin negative for more than 0.25 s")


def test_a_margin_that_is_positive_or_undefined_in_between_starts_the_time_anew(limits):
    for recovered in (300, 550):
        for k in range(49):
            assert stop_at(limits, (0.5, 0.0, 0.0), sample=k)[0] == RUNNING
        assert stop_at(limits, (0.5, 0.0, 0.0), sample=recovered)[0] == RUNNING
    for k in range(50):
        assert stop_at(limits, (0.5, 0.0, 0.0), sample=k)[0] == RUNNING


def test_a_joint_too_fast_has_diverged_even_if_the_body_falls_as_well(limits):
    dq = AT_REST.copy()
    dq[2, 1] = -150.0
    status, cause = stop_at(limits, (0.1, 0.0, 0.0), dq=dq)
    assert status == DIVERGED
    assert cause.endswith("joint 2 of leg 3 moves at 150 rad/s, above 100 rad/s")


def test_a_machine_that_finds_no_balance_at_its_start_has_fallen(make_config):
    """On ground much softer than assumed: nothing is left to diverge, and no row holds what is not finite."""
    config = make_config("scenario=quadruped", "terrain.stiffness=50", "terrain.assumed_stiffness=1e4", "cycles=1")
    for fused in (True, False):
        rollout = roll_out(make_scenario(config), fused=fused)
        assert rollout.status == "fell"
        assert rollout.cause.endswith("the body has no static equilibrium")
        assert np.isfinite(rollout.samples).all()


@pytest.mark.parametrize("stiffness", ["1e5", "1e6"])
def test_it_stands_on_stiff_ground(make_config, stiffness):
    config = make_config("scenario=quadruped", f"terrain.stiffness={stiffness}", "cycles=1", "feedforward=none")
    assert roll_out(make_scenario(config)).status == "completed"


def test_an_unstable_gait_that_is_allowed_runs_until_it_falls(make_config):
    config = make_config("scenario=quadruped", "gait.duty_factor=0.5", "gait.allow_unstable=true", "cycles=2")
    rollout = roll_out(make_scenario(config))
    assert rollout.status == "fell"
    assert len(rollout.samples) > 0
    assert np.isfinite(rollout.samples).all()
