"""Growth of learning with every lead and rate from one linearisation: the lifted map from cycle to cycle.

While a loop repeats the torque u learnt in one cycle, its learning error responds to changes of u as
e(k) = sum_l H(k, l) u(k - l). H is measured by combs of impulses, each of which has decayed before the next. The
law of learning closes this loop: e changes the weights, and these give u. As both are linear, the change from cycle
to cycle follows without the plant, with any lead and rate.
"""

import copy
from dataclasses import dataclass, replace

import numpy as np

from cmacexp.cmac.rules import CONSTANT, ERROR, NEIGHBOURS, ZERO_BY_ERROR
from cmacexp.config import Config
from cmacexp.feedforward.kernels import TABLE, FeedforwardParams, feedforward_step
from cmacexp.jit.compiler import program
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.stability.cycle_map import NUDGE, NotPredictable
from cmacexp.stability.growth import GROWTH_CYCLES, SETTLING_CYCLES, fitted_growth
from cmacexp.stability.transfer import Replay, find_commanded, replay
from cmacexp.typing import Array, Counts

FIRST_SPACING = 120
"""Samples between the impulses of the first comb; doubled until responses decay."""
DECAYED = 0.03
"""Responses are over when they are below this, over their peak, in the tenth of the samples before the next impulse:
with 1e-3 growth is the same to four decimals."""
FIRST_WINDOW = (SETTLING_CYCLES, SETTLING_CYCLES + GROWTH_CYCLES + 1)
LAST_WINDOW = (2 * GROWTH_CYCLES, 3 * GROWTH_CYCLES)
"""Cycles over which growth is fitted."""
MOST_CYCLES = 4
"""Cycles after which a response must have decayed."""


@program
def repeat_cycles(
    feedforward: FeedforwardParams, response: Array, start: Array, torque: Array, error: Array, sizes: Array
) -> None:
    """Learn for as many cycles as ``sizes`` (cycles,) has entries, from weights that are zero.

    Args:
        feedforward: that learns; its weights change.
        response: (N, lags, L J, L J): H; [k, l, j, i] of error i at sample k to torque j, l samples before.
        start: (N, L J): the learning error of the first cycle, whose torque is not counted, N m.
        torque: (more than lags, L, J): the last torques, zero at first, N m.
        error: (L, J): the last learning error, zero at first, N m.
        sizes: filled with the root of the summed squares of the learning error in each cycle, N m.
    """
    samples, lags, joints = response.shape[:3]
    last, now = torque.reshape(-1, joints), error.reshape(-1)
    for cycle in range(sizes.shape[0]):
        power = 0.0
        for k in range(samples):
            step = cycle * samples + k
            feedforward_step(feedforward, step, k, error, torque[step % torque.shape[0]])
            row = last[step % torque.shape[0]]
            for i in range(joints):
                now[i] = start[k, i] if cycle == 0 else 0.0
                row[i] = 0.0 if cycle == 0 else row[i]
            for lag in range(lags):
                before = last[(step - lag) % torque.shape[0]]
                for j in range(joints):
                    for i in range(joints):
                        now[i] += response[k, lag, j, i] * before[j]
            for i in range(joints):
                power += now[i] * now[i]
        sizes[cycle] = np.sqrt(power)


@dataclass(frozen=True)
class Lifted:
    """The loop linearised about the torque learnt in one cycle; ready for any lead and rate."""

    feedforward: FeedforwardParams
    """Its weights are changes, zero at first."""
    response: Array
    """(N, lags, L J, L J): see :func:`repeat_cycles`."""
    start: Array
    """(N, L, J): the learning error of that cycle, N m: it changes what is learnt first."""

    def sizes(self, lead: int, rate: float, cycles: int) -> Array:
        """Root of the summed squares of the change of the learning error, (cycles,), N m, of successive cycles."""
        learner = copy.deepcopy(self.feedforward)
        learner = learner._replace(learning=learner.learning._replace(lead=lead, rate=rate))
        sizes = np.zeros(cycles)
        torque = np.zeros((self.response.shape[1] + 1, *self.start.shape[1:]))
        repeat_cycles(
            learner,
            self.response,
            self.start.reshape(len(self.start), -1),
            torque,
            np.zeros(self.start.shape[1:]),
            sizes,
        )
        return sizes

    def lasting_growth(self, lead: int, rate: float) -> float:
        """The larger of growth over the cycles of ``Growth.per_cycle``, and over those with slow changes alone."""
        sizes = self.sizes(lead, rate, LAST_WINDOW[1])
        return max(_fit(sizes[slice(*FIRST_WINDOW)]), _fit(sizes[slice(*LAST_WINDOW)]))


def _fit(sizes: Array) -> float:
    """Growth per cycle of changes (n,); infinite where they are not finite, 0 where they vanish."""
    if not np.isfinite(sizes).all():
        return float("inf")
    return fitted_growth(sizes) if (sizes > 0.0).all() else 0.0


def _respond(learnt: Replay, config: Config, held: Array, samples: Counts, joint: int, cycles: int) -> Array:
    """Response (cycles N, L J) of the learning error to 1 N m of one joint at some samples of the first cycle."""
    loop, nominal, ends = learnt.loop, learnt.torque.copy(), []
    for sign in (1.0, -1.0):
        loop.put(held)
        learnt.torque.reshape(loop.period, -1)[samples, joint] += sign * NUDGE
        feedback = []
        for _ in range(cycles):
            ended = not loop.advance(loop.period)
            learnt.torque[...] = nominal
            if ended:
                raise NotPredictable(f"a run from nearby ends in cycle {loop.cycles + 1}")
            feedback.append(loop.column("tau_feedback"))
        ends.append(np.concatenate(feedback))
    difference = find_commanded(config, ends[0] - ends[1]) / (2.0 * NUDGE)
    return difference.reshape(len(difference), -1)


def _measure(learnt: Replay, config: Config, lags: int) -> Array:
    """H (N, lags, L J, L J) by combs of impulses that are ``lags`` samples apart."""
    samples, joints = len(learnt.torque), learnt.torque[0].size
    held, cycles = learnt.loop.hold(), 1 + -(-(lags + config.actuator.delay) // samples)
    response = np.zeros((samples, lags, joints, joints))
    after = np.arange(lags)
    for offset in range(min(lags, samples)):
        comb = np.arange(offset, samples, lags)
        reached = comb[:, None] + after
        for joint in range(joints):
            ends = _respond(learnt, config, held, comb, joint, cycles)
            response[reached % samples, after, joint] = ends[reached]
    learnt.loop.put(held)
    return response


def require_linear(feedforward: FeedforwardParams) -> None:
    """Check that a law of learning is linear in the error and the same in every cycle.

    Raises:
        NotPredictable: it is not.
    """
    rule = feedforward.learning.rule
    if feedforward.kind == TABLE:
        raise NotPredictable("nothing learns from cycle to cycle")
    if rule.teaches not in (ERROR, NEIGHBOURS) or rule.goal == ZERO_BY_ERROR or rule.rate != CONSTANT:
        raise NotPredictable("the map needs a learning rule that is linear, without dead zone or a rate that decays")


def unguarded(scenario: Scenario) -> Config:
    """The config of a scenario with its lead and rate as numbers, and without the guard, which would end learning."""
    setup = scenario.setup
    learning = replace(setup.config.learning, guard="none", lead=setup.lead, rate=setup.rate)
    return replace(setup.config, learning=learning)


def lift(config: Config, cycle: int) -> Lifted:
    """Linearise the loop of a config about the torque learnt in the cycle after ``cycle``.

    Raises:
        NotPredictable: the loop or its law of learning is not linear, its plant not analytic, or responses stay.
    """
    scenario = make_scenario(config)
    if not isinstance(scenario.plant, AnalyticPlant):
        raise NotPredictable("only the analytic plant of planar machines is fast enough")
    learnt = replay(unguarded(scenario), cycle)
    require_linear(learnt.feedforward)
    lags = FIRST_SPACING
    while lags <= MOST_CYCLES * len(learnt.torque):
        response = _measure(learnt, config, lags)
        rest = np.abs(response[:, -(lags // 10) :]).max()
        if rest <= DECAYED * np.abs(response).max():
            torque, weights = np.zeros((1, *learnt.torque.shape[1:])), np.zeros_like(learnt.feedforward.weights)
            learner = learnt.feedforward._replace(weights=weights, torque=torque)
            return Lifted(learner, response, learnt.learning_error)
        lags *= 2
    raise NotPredictable(f"responses to a torque have not decayed after {MOST_CYCLES} cycles")
