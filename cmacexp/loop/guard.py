"""The guard of learning: no run ends worse than with feedback only because it learnt.

The guard compares every cycle with a baseline cycle of feedback only, by two root mean squares: the effort (learning
error, J^T U) and the error of feet and body. The score of a cycle is the geometric mean of their ratios to the
baseline, whose score is 1. The guard stores the feedforward torque of the best cycle, and repeats it when learning
does harm. If this does not help either, the run continues with feedback only. The last cycle of a run is not
evaluated. With learnt weights, which act from the first cycle, the baseline is inferred from the sums of that cycle.

The guard is plain Python, which a hook calls at the start of every cycle and after a step beyond the limits; its code
for every step is in :mod:`cmacexp.loop.guard_kernels`.
"""

import math
from collections import deque
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from cmacexp.config.schema import ESTIMATE, REFINE
from cmacexp.data.records import GuardEvent
from cmacexp.feedforward.kernels import FeedforwardParams
from cmacexp.loop.guard_kernels import HIGHEST, SPEED_LIMIT, TILT_LIMIT, CycleSums, Phase, new_guard_state
from cmacexp.loop.probe import LeadProbe
from cmacexp.loop.scenario import Scenario
from cmacexp.models.mechanism import has_body
from cmacexp.models.trend import SIGNIFICANT, TREND_WINDOW, count_rises
from cmacexp.planning.plan import Setup

UPRIGHT = 0.1
"""Body tilt that never raises an alarm, rad."""
HIGHEST_EFFORT = 2.0
"""Highest accepted effort of a cycle relative to feedback only, however small the error."""
CHATTERS = 3.0
"""Ratio of the RMS joint velocity with feedback only to the planned one above which the machine chatters: in
randomised runs it was at most 1.9, or above 3 in a limit cycle."""
DRIFT_RATIO = 1.2
"""Ratio of the mean score of TREND_WINDOW cycles to its lowest value above which a rising trend counts as drift."""
BETTER = 0.98
"""Ratio to the best score below which a cycle becomes the best one; below 1 so that few cycles copy the weights."""
TINY = 1e-300
"""Value added to divisors to avoid division by zero."""
STILL_FALLS = 0.95
"""Ratio to the error of the last cycle up to which an error above the baseline counts as falling."""
SETTLING = 2
"""Cycles after a reversion that are not evaluated."""
MOST_EVENTS = 8
"""Largest number of recorded events."""


class Cause(StrEnum):
    """Cause of a guard event."""

    PEAK = "effort, speed or tilt beyond that of feedback alone"
    WORSE = "feedback alone was better"
    DRIFT = "effort and error drifted"
    CHATTER = "feedback alone chatters, which leaves nothing to learn from"


class SavedWeights:
    """Weight store of the guard; this base class stores nothing."""

    def save(self, cycle: int) -> None:
        """Save the present weights at the end of ``cycle``; 0 is the start of the run."""

    def restore(self) -> None:
        """Restore the saved weights, if the store has any."""


class NetworkWeights(SavedWeights):
    """Weight store for a built-in network; it saves only the rows that the plan uses."""

    def __init__(self, params: FeedforwardParams):
        log = params.log
        legs = zip(params.weights, log.rows.astype(np.intp), log.used, strict=True)
        self._legs = [(weights, rows[:used], weights[rows[:used]]) for weights, rows, used in legs]
        """Per leg: weights, row indices, and saved copy of these rows."""

    def save(self, cycle: int) -> None:
        """Save the present weights."""
        for weights, rows, saved in self._legs:
            np.take(weights, rows, axis=0, out=saved, mode="clip")  # with its default mode it would copy twice

    def restore(self) -> None:
        """Restore the saved weights."""
        for weights, rows, saved in self._legs:
            weights[rows] = saved


class CustomWeights(SavedWeights):
    """Weight store for a custom feedforward: saved for the result of the run, but never restored."""

    def __init__(self, scenario: Scenario):
        self._scenario = scenario

    def save(self, cycle: int) -> None:
        """Save the present weights as those of ``cycle``; only these and the weights at the start, 0, are kept."""
        weights = self._scenario.feedforward.learnt()  # type: ignore[attr-defined]  # it Learns
        self._scenario.kept = {0: self._scenario.kept.get(0, weights), cycle: weights}


class Score(NamedTuple):
    """Effort and error of a cycle relative to feedback only."""

    effort: float
    error: float

    @property
    def mean(self) -> float:
        """Geometric mean of effort and error."""
        return math.sqrt(self.effort * self.error)


class Guard:
    """The guard of one run.

    Attributes:
        state: arrays shared with the loop.
        events: reversions in order, at most the first MOST_EVENTS.
        probe: probe of the feedback delay, before learning and after each reversion.
        learns_again: True if learning restarts with the next cycle, after a probe has ended.
    """

    def __init__(self, setup: Setup, weights: SavedWeights):
        """Make the guard at the start of a run; ``weights`` stores the weights of the guarded feedforward.

        Weights that an earlier run has learnt act at once; the baseline is then inferred from the first cycle.
        """
        mechanism = setup.mechanism
        plan = setup.plan
        config = setup.config
        self.period = len(plan.support)
        self.refines = config.learning.guard == REFINE
        self.start_step = plan.start_step
        self.weights = weights
        estimates = config.learning.lead == ESTIMATE
        self.probe = LeadProbe(self.period, mechanism.shape, config.seed if estimates else None)
        lever = 0.5 * float((mechanism.hips**2).sum()) if has_body(mechanism) else 0.0
        self.state = new_guard_state(self.period, mechanism.shape, self.refines, lever, self.probe.state)
        motion = (plan.joints.velocity**2).sum(axis=1).sum(axis=1)
        self.planned_motion = float(motion.sum())
        self.state.limits[SPEED_LIMIT] = HIGHEST[SPEED_LIMIT] ** 2 * motion.max()
        self.state.limits[TILT_LIMIT] = UPRIGHT**2
        self.phase = Phase.BASELINE
        if setup.learnt is not None and not estimates:
            self.phase = Phase.LEARNING
            self.state.infers[0] = 1
        self.baseline_effort = self.baseline_error = 0.0
        """Square roots of the sums of squares over a cycle with feedback only."""
        self.best_cycle = 0
        """Number of the best cycle; 0: with feedback only."""
        self.best_score = 1.0
        self.best_torque = np.zeros_like(self.state.torque)
        self.scores = deque[float](maxlen=TREND_WINDOW)
        """Scores of the last cycles since learning began or the last reversion."""
        self.lowest_score = math.inf
        """Lowest mean score over TREND_WINDOW cycles."""
        self.last_error = 0.0
        """Error of the last evaluated cycle relative to feedback only."""
        self.settling = 0
        """Number of coming cycles that are not evaluated."""
        self.learns_again = False
        self.events: list[GuardEvent] = []
        weights.save(0)

    @property
    def phase(self) -> Phase:
        """Source of the torque that acts in addition to the feedback."""
        return Phase(int(self.state.phase[0]))

    @phase.setter
    def phase(self, phase: Phase) -> None:
        self.state.phase[0] = phase

    def begin_step(self, step: int) -> None:
        """Handle an alarm and the end of a cycle, before ``step``.

        A hook calls this before the first step of each cycle and before a step that follows an alarm.
        """
        if self.state.alarm[0]:
            self.state.alarm[0] = 0
            self.alarm(step)
        if step > 0 and step % self.period == 0:
            self.end_cycle(step)

    def alarm(self, step: int) -> None:
        """Revert to the best cycle after a step beyond the limits; ignored while a refined torque settles."""
        refines = self.phase is Phase.REFINING and self.settling == 0 and self.probe.is_idle
        if self.phase is Phase.LEARNING or refines:
            self._revert_to_best(step, Cause.PEAK)

    def end_cycle(self, step: int) -> None:
        """Evaluate the cycle that ended before ``step``, unless it was part of a probe, and clear the sums."""
        if self.probe.cycles_left == 0:
            self._evaluate_cycle(step, CycleSums(*self.state.sums.tolist()))
        self.state.sums[:] = 0.0
        idle = self.settling == 0 and self.probe.is_idle
        self.state.corrects[0] = self.phase is Phase.REFINING and idle

    def _evaluate_cycle(self, step: int, sums: CycleSums) -> None:
        infers = bool(self.state.infers[0])
        chatters = 0.0 < CHATTERS * CHATTERS * self.planned_motion < sums.motion
        self.state.infers[0] = 0
        if self.phase is Phase.BASELINE:
            self._end_baseline_cycle(step, sums, chatters)
        elif self.learns_again:
            self._learn()
        elif infers and chatters:
            self._revert_to_best(step, Cause.CHATTER)
        elif infers:
            self._infer_baseline(sums)
            self._keep_best(step // self.period)
        elif self.settling > 0:
            self.settling -= 1
            if self.settling == 0 and self.best_cycle == 0:
                self._measure_baseline(sums)  # again: the first cycle started from rest
        elif not self.probe.begin(self.baseline_effort) and self.phase is not Phase.FEEDBACK_ONLY:
            effort = math.sqrt(sums.effort) / self.baseline_effort
            error = math.sqrt(sums.error) / self.baseline_error
            self._compare(step, Score(effort, error))

    def _end_baseline_cycle(self, step: int, sums: CycleSums, chatters: bool) -> None:
        """Evaluate a cycle before learning: measure the baseline, then start the probe or learning when due."""
        if self.probe.ended == 0:
            self._measure_baseline(sums)
        if chatters:
            self._revert_to_best(step, Cause.CHATTER)
        else:
            begins_probe = step // self.period > 1 and self.probe.begin(self.baseline_effort)
            if not begins_probe and self.probe.is_idle and step >= self.start_step:
                self._learn()

    def _compare(self, step: int, score: Score) -> None:
        """Store the last cycle as the best one, revert to the best one, or do neither, by its ``score``."""
        drifts = self._has_drifted(score.mean)
        frozen = self.phase is Phase.FROZEN
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
        """Add ``score``; return True if the last TREND_WINDOW scores rise and their mean is far above its lowest."""
        self.scores.append(score)
        if len(self.scores) < TREND_WINDOW:
            return False
        mean = math.fsum(self.scores) / TREND_WINDOW
        self.lowest_score = min(self.lowest_score, mean)
        return mean > DRIFT_RATIO * self.lowest_score and count_rises(self.scores) >= SIGNIFICANT

    def _measure_baseline(self, sums: CycleSums) -> None:
        """Compute the baseline from the ``sums`` of a cycle with feedback only."""
        self.baseline_effort = math.sqrt(sums.effort) + TINY
        self.baseline_error = math.sqrt(sums.error) + TINY

    def _infer_baseline(self, sums: CycleSums) -> None:
        """Infer the baseline from a cycle with learnt weights.

        Feedback only would have to supply the sum of feedback and feedforward, with errors in proportion.
        """
        self._measure_baseline(sums)
        self.best_score = self.baseline_effort / (math.sqrt(sums.demand) + TINY)
        self.baseline_effort /= self.best_score
        self.baseline_error /= self.best_score

    def _learn(self) -> None:
        """Start learning from the present weights, which are those of the best cycle."""
        self.phase = Phase.LEARNING
        self.scores.clear()
        self.learns_again = False

    def _keep_best(self, cycle: int) -> None:
        """Store torque and weights of the last cycle as the best ones."""
        self.best_cycle = cycle
        self.best_torque[...] = self.state.torque
        self.weights.save(cycle)

    def _revert_to_best(self, step: int, cause: Cause) -> None:
        """Restore torque and weights of the best cycle; use feedback only if there is none or it did not help."""
        if self.phase is Phase.FROZEN:
            self.best_cycle = 0
            self.best_torque[...] = 0.0
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
            self.events.append(
                GuardEvent(cycle=step // self.period + 1, step=step, cause=str(cause), restored=self.best_cycle)
            )
