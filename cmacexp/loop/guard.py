"""The guard of learning: no run ends worse than with feedback only because it learnt.

The guard compares every cycle with one of feedback only, by two root mean squares: that of the effort (the learning
error, J^T U) and that of the error of feet and body. The score of a cycle is the geometric mean of their ratios to
those of feedback only, which has the score 1. The guard keeps the feedforward torque of the best cycle; when learning
does harm, that torque is repeated. If this does not help either, feedback goes on alone. The last cycle of a run is
not evaluated. Where learnt weights act from the first cycle, that of feedback only is inferred from its sums.

It is plain Python that a hook calls at the start of every cycle and after a step beyond the limits; what it needs of
every step is in :mod:`cmacexp.loop.guard_kernels`.
"""

import math
from collections import deque
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from cmacexp.config.schema import ESTIMATE, REFINE
from cmacexp.data.records import GuardEvent
from cmacexp.loop.guard_kernels import HIGHEST, SPEED_LIMIT, TILT_LIMIT, CycleSums, Phase, new_guard_state
from cmacexp.loop.probe import LeadProbe
from cmacexp.loop.saved_weights import SavedWeights
from cmacexp.models.mechanism import has_body
from cmacexp.models.trend import SIGNIFICANT, WINDOW, count_rises
from cmacexp.planning.plan import Setup

UPRIGHT = 0.1
"""Tilt of a body below which it is far from a fall, rad."""
HIGHEST_EFFORT = 2.0
"""Effort of a cycle, over that of feedback only, that no smaller error justifies."""
CHATTERS = 3.0
"""Root mean square of the joint velocities with feedback only, over that planned, above which it chatters: in random
worlds it was up to 1.9, or in a limit cycle above 3."""
DRIFT_RATIO = 1.2
"""Ratio of the mean score of WINDOW cycles to its lowest at which a trend is a drift."""
BETTER = 0.98
"""Ratio to the score of the best cycle below which a cycle becomes the best one: most cycles copy nothing."""
TINY = 1e-300
"""Is added to divisors that may be 0."""
STILL_FALLS = 0.95
"""Ratio to the error of the last cycle up to which an error above that of feedback only still falls."""
SETTLING = 2
"""Cycles after a retreat that are not evaluated."""
MOST_EVENTS = 8


class Cause(StrEnum):
    """Why the guard acted."""

    PEAK = "effort, speed or tilt beyond that of feedback alone"
    WORSE = "feedback alone was better"
    DRIFT = "effort and error drifted"
    CHATTER = "feedback alone chatters, which leaves nothing to learn from"


class Score(NamedTuple):
    """Effort and error of a cycle, over those of feedback only."""

    effort: float
    error: float

    @property
    def mean(self) -> float:
        """Their geometric mean."""
        return math.sqrt(self.effort * self.error)


class Guard:
    """The guard of one run.

    Attributes:
        state: what the loop sees of it.
        events: what it did, in their order, the first MOST_EVENTS.
        probe: of the delay of the feedback, before learning and after each retreat.
        learns_again: whether learning is to begin again with the next cycle, since a probe has ended.
    """

    def __init__(self, setup: Setup, weights: SavedWeights):
        """A guard at the start of a run; ``weights`` are those of the feedforward that it guards.

        Weights that an earlier run has learnt act at once: the first cycle takes the place of that of feedback only.
        """
        mechanism = setup.mechanism
        plan = setup.plan
        config = setup.config
        shape, self.period = mechanism.shape, len(plan.support)
        self.refines = config.learning.guard == REFINE
        self.start_step = plan.start_step
        self.weights = weights
        estimates = config.learning.lead == ESTIMATE
        self.probe = LeadProbe(self.period, shape, config.seed if estimates else None)
        lever = 0.5 * float((mechanism.hips**2).sum()) if has_body(mechanism) else 0.0
        self.state = new_guard_state(self.period, shape, self.refines, lever, self.probe.state)
        motion = (plan.joints.velocity**2).sum(axis=1).sum(axis=1)
        self.planned_motion = float(motion.sum())
        self.state.limits[SPEED_LIMIT] = HIGHEST[SPEED_LIMIT] ** 2 * motion.max()
        self.state.limits[TILT_LIMIT] = UPRIGHT**2
        self.phase = Phase.BASELINE
        if setup.learnt is not None and not estimates:
            self.phase, self.state.infers[0] = Phase.LEARNING, 1
        self.baseline_effort = self.baseline_error = 0.0
        """Roots of the sums of squares of a cycle with feedback only."""
        self.best_cycle = 0
        """Number of the best cycle; 0: with feedback only."""
        self.best_score = 1.0
        self.best_torque = np.zeros_like(self.state.torque)
        self.scores = deque[float](maxlen=WINDOW)
        """Last scores of cycles since learning began or the last return to the best cycle."""
        self.lowest_score = math.inf
        """Lowest mean of a whole window of them."""
        self.last_error = 0.0
        """Error of the last of them."""
        self.settling = 0
        """Cycles that are not evaluated any more."""
        self.learns_again = False
        self.events: list[GuardEvent] = []
        weights.save(0)

    @property
    def phase(self) -> Phase:
        """What acts besides the feedback."""
        return Phase(int(self.state.phase[0]))

    @phase.setter
    def phase(self, phase: Phase) -> None:
        self.state.phase[0] = phase

    def begin_step(self, step: int) -> None:
        """What a hook calls before the first step of a cycle, and before one that follows an alarm."""
        if self.state.alarm[0]:
            self.state.alarm[0] = 0
            self.alarm(step)
        if step > 0 and step % self.period == 0:
            self.end_cycle(step)

    def alarm(self, step: int) -> None:
        """End learning after a step beyond the limits, before ``step``; a repeated torque only once it is settled."""
        refines = self.phase is Phase.REFINING and self.settling == 0 and self.probe.is_idle
        if self.phase is Phase.LEARNING or refines:
            self._revert_to_best(step, Cause.PEAK)

    def end_cycle(self, step: int) -> None:
        """Evaluate the cycle that has ended before ``step``, and begin another one."""
        if self.probe.cycles_left == 0:
            self._evaluate_cycle(step, CycleSums(*self.state.sums.tolist()))
        self.state.sums[:] = 0.0
        idle = self.settling == 0 and self.probe.is_idle
        self.state.corrects[0] = self.phase is Phase.REFINING and idle

    def _evaluate_cycle(self, step: int, sums: CycleSums) -> None:
        cycle, infers = step // self.period, bool(self.state.infers[0])
        chatters = 0.0 < CHATTERS * CHATTERS * self.planned_motion < sums.motion
        self.state.infers[0] = 0
        if self.phase is Phase.BASELINE:
            if self.probe.ended == 0:
                self._measure_baseline(sums)
            if chatters:
                self._revert_to_best(step, Cause.CHATTER)
            elif cycle > 1 and self.probe.begin(self.baseline_effort):
                return
            elif self.probe.is_idle and step >= self.start_step:
                self._learn()
        elif self.learns_again:
            self._learn()
        elif infers and chatters:
            self._revert_to_best(step, Cause.CHATTER)
        elif infers:
            self._infer_baseline(sums)
            self._keep_best(cycle)
        elif self.settling > 0:
            self.settling -= 1
            if self.settling == 0 and self.best_cycle == 0:
                self._measure_baseline(sums)  # again: the first cycle started from rest
        elif not self.probe.begin(self.baseline_effort) and self.phase is not Phase.FEEDBACK_ONLY:
            effort, error = math.sqrt(sums.effort), math.sqrt(sums.error)
            self._compare(step, Score(effort / self.baseline_effort, error / self.baseline_error))

    def _compare(self, step: int, score: Score) -> None:
        """Take the cycle that has ended as the best one, or retreat, or neither."""
        drifts, frozen = self._has_drifted(score.mean), self.phase is Phase.FROZEN
        first = self.phase is Phase.LEARNING and len(self.scores) == 1
        if not frozen and score.mean < BETTER * self.best_score and score.error < 1.0:
            self.best_score = score.mean
            self._keep_best(step // self.period)
        elif not first and (score.effort > HIGHEST_EFFORT or score.error > max(1.0, STILL_FALLS * self.last_error)):
            self._revert_to_best(step, Cause.WORSE)
        elif drifts and not frozen:
            self._revert_to_best(step, Cause.DRIFT)
        self.last_error = score.error

    def _has_drifted(self, score: float) -> bool:
        """Whether the scores of the last WINDOW cycles rise, and their mean is far above its lowest."""
        self.scores.append(score)
        if len(self.scores) < WINDOW:
            return False
        mean = math.fsum(self.scores) / WINDOW
        self.lowest_score = min(self.lowest_score, mean)
        return mean > DRIFT_RATIO * self.lowest_score and count_rises(self.scores) >= SIGNIFICANT

    def _measure_baseline(self, sums: CycleSums) -> None:
        """Take the cycle that has ended as one of feedback only."""
        self.baseline_effort, self.baseline_error = (math.sqrt(each) + TINY for each in (sums.effort, sums.error))

    def _infer_baseline(self, sums: CycleSums) -> None:
        """Feedback only would have to give what feedback and feedforward gave, with errors in proportion."""
        self._measure_baseline(sums)
        self.best_score = self.baseline_effort / (math.sqrt(sums.demand) + TINY)
        self.baseline_effort /= self.best_score
        self.baseline_error /= self.best_score

    def _learn(self) -> None:
        """Learn from now on, from the weights of the best cycle."""
        self.phase = Phase.LEARNING
        self.scores.clear()
        self.learns_again = False

    def _keep_best(self, cycle: int) -> None:
        """Keep torque and weights of the cycle that has ended."""
        self.best_cycle = cycle
        self.best_torque[...] = self.state.torque
        self.weights.save(cycle)

    def _revert_to_best(self, step: int, cause: Cause) -> None:
        """Return to torque and weights of the best cycle; to feedback only if there is none, or it did not help."""
        if self.phase is Phase.FROZEN:
            self.best_cycle, self.best_torque[...] = 0, 0.0
        refines = self.refines and self.phase is Phase.LEARNING
        repeats = Phase.FROZEN if self.best_cycle > 0 else Phase.FEEDBACK_ONLY
        self.phase = Phase.REFINING if refines else repeats
        self.state.torque[...] = self.best_torque
        self.weights.restore()
        self.settling = SETTLING
        self.scores.clear()
        self.lowest_score = math.inf
        self.probe.repeat(cause is not Cause.CHATTER)
        if len(self.events) < MOST_EVENTS:
            cycle = step // self.period + 1
            self.events.append(GuardEvent(cycle=cycle, step=step, cause=str(cause), restored=self.best_cycle))
