"""Actuators: delay, limit, rate limit and first-order lag of the commanded torques."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.config.schema import ActuatorConfig
from cmacexp.jit.compiler import kernel
from cmacexp.models.loop_delay import first_order_share
from cmacexp.typing import STATE, Array, Role, State


class Actuator(NamedTuple):
    """Parameters and state of the actuators of L legs with J joints each."""

    limit: tuple[float, ...]
    """(J,): largest absolute torque of each joint of a leg, N m; infinite: no limit."""
    change: float
    """Largest change of a torque from one step to the next, N m; infinite: no limit."""
    delay: int
    """Delay from command to torque, samples."""
    delay_buffer: Annotated[Array, Role("state", ring_axis=0)]
    """(delay + 1, 2, L, J): commanded feedback and feedforward of the last steps, N m; empty without a delay."""
    last: State
    """(L, J): torque of the last step before the lag, N m."""
    share: float
    """Lag gain: fraction of (command - torque) added per step; 1 without a lag."""
    lagged: Annotated[Array | None, STATE]
    """(2, L, J): feedback and feedforward after the lag in the last step, N m; None without a lag, because a test in
    each step would take a fifth of its time."""


def new_actuator(
    config: ActuatorConfig, sampling_period: float, legs: int, motors: tuple[float, ...] = (math.inf, math.inf)
) -> Actuator:
    """Make the actuators of ``legs`` legs at rest: the torque is zero until the first command arrives.

    ``motors`` (J,) holds the torque limit of each joint's motor, N m, which the config can only lower.
    """
    joints = len(motors)
    return Actuator(
        tuple(min(config.limit, motor_limit) for motor_limit in motors),
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

    ``feedback`` (L, J) is reduced in place, and ``feedforward`` (L, J) only where it exceeds the limit by itself.
    ``torque`` (L, J) is filled with their sum, the input of the plant; all in N m.
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
def apply_delay(actuator: Actuator, step: int, feedback: Array, feedforward: Array) -> None:
    """Replace the commands of ``step`` by those of ``delay`` steps before, 0 before the first; (L, J), N m."""
    now = actuator.delay_buffer[step % actuator.delay_buffer.shape[0]]
    delayed = actuator.delay_buffer[(step - actuator.delay) % actuator.delay_buffer.shape[0]]
    for i in range(feedback.shape[0]):
        for j in range(len(actuator.limit)):
            now[0, i, j], now[1, i, j] = feedback[i, j], feedforward[i, j]
            feedback[i, j], feedforward[i, j] = delayed[0, i, j], delayed[1, i, j]


@kernel
def limit_rate(actuator: Actuator, feedback: Array, feedforward: Array, torque: Array) -> None:
    """Limit the change of every torque to ``actuator.change``; the feedback absorbs the difference.

    ``feedback`` and ``torque`` (L, J), N m, change in place; ``feedforward`` (L, J) does not.
    """
    for i in range(torque.shape[0]):
        for j in range(len(actuator.limit)):
            lowest, highest = actuator.last[i, j] - actuator.change, actuator.last[i, j] + actuator.change
            total = min(max(torque[i, j], lowest), highest)
            if total != torque[i, j]:
                feedback[i, j] = total - feedforward[i, j]
                torque[i, j] = feedback[i, j] + feedforward[i, j]
            actuator.last[i, j] = torque[i, j]


@kernel
def apply_lag(lagged: Array | None, share: float, feedback: Array, feedforward: Array, torque: Array) -> None:
    """Pass feedback and feedforward (L, J), N m, through first-order lags; fill ``torque`` with their sum.

    The lags are linear, so filtering the two separately keeps the sum right. ``lagged`` None: no lag.
    """
    if lagged is not None:
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                lagged[0, i, j] += share * (feedback[i, j] - lagged[0, i, j])
                lagged[1, i, j] += share * (feedforward[i, j] - lagged[1, i, j])
                feedback[i, j], feedforward[i, j] = lagged[0, i, j], lagged[1, i, j]
                torque[i, j] = feedback[i, j] + feedforward[i, j]


@kernel
def actuate(actuator: Actuator, step: int, feedback: Array, feedforward: Array, torque: Array) -> None:
    """Pass the torques commanded in ``step`` through delay, limit, rate limit and lag, in this order.

    The state of ``actuator`` advances: call it once for each of consecutive steps. Limits act on the sum: feedback
    gives way first, feedforward only where it exceeds the torque limit by itself. ``feedback`` and ``feedforward``
    (L, J), N m, are replaced by the torques that act; ``torque`` (L, J), N m, is filled with their sum, the input of
    the plant.
    """
    if actuator.delay > 0:
        apply_delay(actuator, step, feedback, feedforward)
    saturate(actuator.limit, feedback, feedforward, torque)
    if actuator.change < np.inf:
        limit_rate(actuator, feedback, feedforward, torque)
    apply_lag(actuator.lagged, actuator.share, feedback, feedforward, torque)
