"""What was seen just before a run fell or diverged: added to its message where the data support it."""

from collections.abc import Sequence

import numpy as np

from cmacexp.data.records import Drift
from cmacexp.data.trace import Trace, concat_traces
from cmacexp.loop.scenario import Scenario
from cmacexp.models.robot_gains import PERIODS
from cmacexp.typing import Status

BEFORE_END = 0.02
"""What counts as just before the end, s; one step at least."""
AT_LIMIT = 0.999
"""Share of its limit from which a torque is at it: behind a lag it only comes near."""
MOST = 3
"""Legs or joints that are named, of those to which the same happened."""


def explain_stop(scenario: Scenario, traces: Sequence[Trace], drift: Drift | None) -> str:
    """Explain the end of a run that fell or diverged, to follow its cause; empty if nothing was seen.

    ``traces`` are those of the last steps at least, ``drift`` is that of learning. It reports what was
    seen, which need not be why: torques at their limit, a foot that carries nothing where it should, a drift of
    learning; and whether learning can be the cause at all.
    """
    end = scenario.end
    if end.status not in (Status.FELL, Status.DIVERGED) or not end.steps:
        return ""
    setup, trace = scenario.setup, concat_traces(traces)
    trace = trace.select(slice(-max(1, round(BEFORE_END / setup.config.sampling_period)), None))
    torque = trace.stack_joints("tau_feedback_{}") + trace.stack_joints("tau_feedforward_{}")
    limits = np.minimum(setup.mechanism.torque_limits, setup.config.actuator.limit)
    limited = (np.abs(torque) >= AT_LIMIT * limits).all(axis=0)
    found = [f"joint {joint + 1} of leg {leg + 1} at its torque limit" for leg, joint in np.argwhere(limited)]
    if trace.legs > 1:
        unloaded = np.flatnonzero((trace.support & (trace["force"] <= 0.0)).all(axis=0))
        found += [f"leg {leg + 1} without load in its planned support" for leg in unloaded]
    more = [f"and {len(found) - MOST} more"] if len(found) > MOST else []
    clauses = [f"throughout the last {BEFORE_END:g} s {', '.join([*found[:MOST], *more])}"] if found else []
    if drift is not None:
        clauses.append(f"learning had drifted since cycle {drift.cycle}")
    elif scenario.feedforward.acts and end.steps <= setup.plan.start_step:
        clauses.append("it had not begun to learn")
        if setup.config.machine.kind == "robot" and setup.config.sampling_period > PERIODS[0][0]:
            clauses.append(f"try sampling_period={PERIODS[0][0]:g}")
    elif scenario.feedforward.acts and not scenario.is_live:
        clauses.append("feedforward=none shows whether feedback only would have stopped too")
    return "".join(f"; {clause}" for clause in clauses)
