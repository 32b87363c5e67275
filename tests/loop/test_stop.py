"""What stops a run: it diverges, or its machine falls; and kernels that find every value that is not finite."""

import numpy as np
import pytest
from support.doors import (
    Hook,
    make_mechanism,
    make_scenario,
    new_measurement,
    new_observation,
    new_state,
    roll_out,
)

from cmacexp.loop.step import check
from cmacexp.loop.stop import (
    DIVERGED,
    FASTEST_JOINT,
    FELL,
    LONGEST_UNSTABLE,
    LOWEST_HIP,
    RUNNING,
    STEEPEST,
    describe_stop,
    new_limits,
    observes_finite,
    stop_reason,
)

PERIOD = 0.005
LEVEL = (0.5, 0.0, 0.0)
"""Height, pitch and roll of a body."""
STATE = ("q", "dq", "foot", "velocity", "force", "body", "body_rate")
CALLED = Hook(lambda step: None)
"""Of an external plant."""
NOT_FINITE = (np.nan, np.inf, -np.inf)


@pytest.fixture
def limits(make_config):
    """Limits whose planned margin is negative in the first hundred samples, and undefined in the last."""
    mechanism = make_mechanism(make_config("scenario=quadruped").machine)
    return new_limits(mechanism, np.r_[np.full(100, -1e-3), np.full(400, 0.02), np.full(100, np.nan)], PERIOD)


def at_rest(body=LEVEL):
    return new_measurement(4)._replace(force=np.full(4, 10.0), body=np.array(body, dtype=float))


def spoil(state, check, expected, names):
    """Expect what ``check`` gives of every entry that is not finite, one at a time."""
    for name in names:
        for entry in np.ndindex(np.shape(getattr(state, name))):
            before = getattr(state, name)[entry]
            for value in NOT_FINITE:
                getattr(state, name)[entry] = value
                assert check() == expected, (name, entry, value)
            getattr(state, name)[entry] = before


def test_every_value_that_is_not_finite_is_found_in_every_entry(limits):
    state, observation, measured = at_rest(), new_observation(3), new_state(4)
    assert observes_finite(observation)
    spoil(observation, lambda: observes_finite(observation), False, STATE)
    assert stop_reason(limits, 300, state) == RUNNING
    spoil(state, lambda: stop_reason(limits, 300, state), DIVERGED, ("q", "dq", "foot", "force"))
    spoil(state, lambda: stop_reason(limits, 300, state), FELL, ("body",))
    measured.force[:], measured.body[:] = 10.0, LEVEL  # of an external plant
    assert check(CALLED, limits, 300, measured) == RUNNING
    spoil(
        measured, lambda: check(CALLED, limits, 300, measured), DIVERGED, [name for name in STATE if name != "body"]
    )


def test_a_joint_may_be_as_fast_as_the_limit_and_no_faster_either_way(limits):
    for leg, joint, way in np.ndindex(4, 2, 2):
        state = at_rest((0.1, 0.0, 0.0))  # the body has fallen as well, but divergence comes first
        for speed, status in ((FASTEST_JOINT, FELL), (np.nextafter(FASTEST_JOINT, np.inf), DIVERGED)):
            state.dq[leg, joint] = (-1) ** way * speed
            assert stop_reason(limits, 300, state) == status
        assert f"joint {joint + 1} of leg {leg + 1}" in describe_stop(limits, DIVERGED, 200, PERIOD, state)


@pytest.mark.parametrize(
    ("body", "named"),
    [
        ((0.5, STEEPEST, 0.0), ""),
        ((0.5, 0.0, -STEEPEST), ""),
        ((LOWEST_HIP, 0.0, 0.0), ""),
        ((0.55, 0.3, -0.3), ""),
        ((np.nan, 0.0, 0.0), "static equilibrium"),
        ((10.0, np.nextafter(STEEPEST, 1.0), 0.0), "pitch 0.500"),
        ((0.5, -0.51, 0.3), "pitch -0.510"),
        ((0.5, 0.3, 0.51), "roll 0.510"),
        ((10.0, 0.0, -np.nextafter(STEEPEST, 1.0)), "roll -0.500"),
        ((0.24, 0.0, 0.0), "hip of leg 1 at 0.240 m"),
        ((0.3, 0.1, 0.14), "hip of leg 2 at 0.246 m"),  # down in front and on the right
        ((0.3, -0.2, -0.15), "hip of leg 3 at 0.222 m"),
    ],
)
def test_a_body_beyond_its_limits_has_fallen_and_the_cause_says_step_time_and_what(limits, body, named):
    state = at_rest(body)
    assert stop_reason(limits, 300, state) == (FELL if named else RUNNING)
    if named:
        cause = describe_stop(limits, FELL, 200, PERIOD, state)
        assert "step 200" in cause
        assert "1.000 s" in cause
        assert named in cause


def test_a_negative_margin_or_unborne_body_is_a_fall_when_it_lasts_longer_than_a_quarter_of_a_second(limits):
    longest, born = round(LONGEST_UNSTABLE / PERIOD), at_rest()
    for recovered in (300, 550):  # with a positive margin, or an undefined one, time starts anew
        reasons = [stop_reason(limits, k, born) for k in [*range(longest), recovered]]
        assert reasons == [RUNNING] * (longest + 1)
    assert [stop_reason(limits, k, born) for k in range(longest + 1)] == [RUNNING] * longest + [FELL]
    assert "margin" in describe_stop(limits, FELL, 200, PERIOD, born)
    falling = born._replace(force=np.zeros(4))
    assert [stop_reason(limits, 300, falling) for _ in range(longest + 1)] == [RUNNING] * longest + [FELL]
    assert "no foot" in describe_stop(limits, FELL, 200, PERIOD, falling)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("settings", "status", "cause"),
    [
        # On ground much softer than assumed it finds no balance at its start, and nothing is left to diverge.
        (("terrain.stiffness=50", "terrain.assumed_stiffness=1e4", "cycles=1"), "fell", "static equilibrium"),
        (("gait.duty_factor=0.5", "gait.allow_unstable=true", "gait.cycle_time=1.5"), "fell", ""),
        (("terrain.stiffness=1e6", "cycles=1", "feedforward=none", "gait.cycle_time=1.5"), "completed", ""),
    ],
)
def test_a_walk_stands_on_stiff_ground_and_falls_without_balance(make_config, settings, status, cause):
    run = roll_out(make_scenario(make_config("scenario=quadruped", *settings)))
    assert run.status == status
    assert cause in (run.cause or "")
    assert np.isfinite(run.samples).all()
