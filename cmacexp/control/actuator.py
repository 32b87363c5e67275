"""The actuators: delay, limit, rate limit and lag of the commanded torques."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.config.schema import ActuatorConfig
from cmacexp.jit.compiler import kernel
from cmacexp.models.loop_delay import first_order_share
from cmacexp.typing import STATE, Array, Role, State


class Actuator(NamedTuple):
    """Limits, delay and lag of the torques of all joints, and their state."""

    limit: tuple[float, ...]
    """(J,): largest absolute torque of each joint of a leg, N m; infinite for none."""
    change: float
    """Largest change of a torque from one step to the next, N m; infinite for none."""
    delay: int
    """Samples from command to action."""
    delay_buffer: Annotated[Array, Role("state", ring_axis=0)]
    """(delay + 1, 2, L, J): commanded feedback and feedforward of the last steps, N m; empty without a delay."""
    last: State
    """(L, J): torque of the last step, N m, before the lag."""
    share: float
    """Part of its difference from the command by which a torque changes in a step; 1 without a lag."""
    lagged: Annotated[Array | None, STATE]
    """(2, L, J): feedback and feedforward that acted in the last step, N m; None without a lag, since a test in each
    step would take a fifth of its time."""


def new_actuator(
    config: ActuatorConfig, sampling_period: float, legs: int, motors: tuple[float, ...] = (math.inf, math.inf)
) -> Actuator:
    """Actuators at rest: until the first command arrives the torque is zero.

    ``motors`` (J,) are the largest absolute torques of each joint of a leg, N m, which the config can only lower.
    """
    joints = len(motors)
    return Actuator(
        tuple(min(config.limit, own) for own in motors),
        float("inf") if config.rate_limit is None else config.rate_limit * sampling_period,
        config.delay,
        np.zeros((config.delay + 1 if config.delay else 0, 2, legs, joints)),
        np.zeros((legs, joints)),
        first_order_share(config.lag, sampling_period),
        np.zeros((2, legs, joints)) if config.lag else None,
    )


@kernel
def saturate(limit: tuple[float, ...], feedback: Array, feedforward: Array, torque: Array) -> None:
    """Limit the torque of every joint to its ``limit`` (J,), N m; the feedback is reduced first.

    ``feedback`` (L, J) is reduced in place, and ``feedforward`` (L, J) where it alone exceeds the limit. ``torque``
    (L, J) is filled with their sum, the input of the plant; all in N m.
    """
    for i in range(torque.shape[0]):
        for j in range(len(limit)):
            feedforward[i, j] = min(max(feedforward[i, j], -limit[j]), limit[j])
            total = feedback[i, j] + feedforward[i, j]
            if total > limit[j]:
                feedback[i, j] = limit[j] - feedforward[i, j]
            elif total < -limit[j]:
                feedback[i, j] = -limit[j] - feedforward[i, j]
            torque[i, j] = feedback[i, j] + feedforward[i, j]


@kernel
def postpone(actuator: Actuator, step: int, feedback: Array, feedforward: Array) -> None:
    """Replace the torques of ``step`` by those of ``delay`` steps ago, zero before the first; all (L, J), N m."""
    delay_buffer = actuator.delay_buffer
    now, then = step % delay_buffer.shape[0], (step - actuator.delay) % delay_buffer.shape[0]
    for i in range(feedback.shape[0]):
        for j in range(len(actuator.limit)):
            delay_buffer[now, 0, i, j], delay_buffer[now, 1, i, j] = feedback[i, j], feedforward[i, j]
            feedback[i, j], feedforward[i, j] = delay_buffer[then, 0, i, j], delay_buffer[then, 1, i, j]


@kernel
def slow_down(actuator: Actuator, feedback: Array, feedforward: Array, torque: Array) -> None:
    """Limit the change of every torque, (L, J), N m, to ``change``; the difference is attributed to the feedback."""
    for i in range(torque.shape[0]):
        for j in range(len(actuator.limit)):
            lowest, highest = actuator.last[i, j] - actuator.change, actuator.last[i, j] + actuator.change
            total = min(max(torque[i, j], lowest), highest)
            if total != torque[i, j]:
                feedback[i, j] = total - feedforward[i, j]
                torque[i, j] = feedback[i, j] + feedforward[i, j]
            actuator.last[i, j] = torque[i, j]


@kernel
def follow(lagged: Array | None, share: float, feedback: Array, feedforward: Array, torque: Array) -> None:
    """Replace the torques, (L, J), N m, by those of first-order lags, which are linear: each part has its own."""
    if lagged is not None:
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                lagged[0, i, j] += share * (feedback[i, j] - lagged[0, i, j])
                lagged[1, i, j] += share * (feedforward[i, j] - lagged[1, i, j])
                feedback[i, j], feedforward[i, j] = lagged[0, i, j], lagged[1, i, j]
                torque[i, j] = feedback[i, j] + feedforward[i, j]


@kernel
def actuate(actuator: Actuator, step: int, feedback: Array, feedforward: Array, torque: Array) -> None:
    """Compute the torques of the plant from those commanded in ``step``: delayed, limited, limited in rate, lagging.

    Steps count from 0 and must follow each other. ``feedback`` and ``feedforward`` (L, J), N m, are replaced by those
    that act; ``torque`` (L, J) is filled with their sum, the input of the plant.
    """
    if actuator.delay > 0:
        postpone(actuator, step, feedback, feedforward)
    saturate(actuator.limit, feedback, feedforward, torque)
    if actuator.change < np.inf:
        slow_down(actuator, feedback, feedforward, torque)
    follow(actuator.lagged, actuator.share, feedback, feedforward, torque)
