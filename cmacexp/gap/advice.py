"""What a log means for learning on its robot: one sentence, and the hyperparameters that follow."""

from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.cmac.rules import derive_rate
from cmacexp.gap.analysis import FIRST, Gap
from cmacexp.loop.guard import DRIFT_RATIO
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.robot_gains import DECAY_TIME, choose_feedback
from cmacexp.typing import Array


def find_best(values: dict[str, Any]) -> str:
    """The predictor that leaves the least torque in the mean."""
    return min(values["left"], key=lambda name: float(values["left"][name]["value"]))


def summarise(values: dict[str, Any]) -> str:
    """The first sentences of the page, with n and intervals."""
    left, best = values["left"], find_best(values)
    own, fastest = left[best], left[best]["fastest"]
    text = "Of the feedback torque of this log "
    if "model" in left:
        text += f"the model of {Path(values['robot']).name} leaves {left['model']['value']:.1f} % and "
    text += (
        f"the best predictor ({best}) {own['value']:.1f} % [{own['low']:.1f}, {own['high']:.1f}] on {own['n']} "
        f"strokes that it had not seen, {fastest['value']:.1f} % [{fastest['low']:.1f}, {fastest['high']:.1f}] on "
        "the fastest."
    )
    if values["lag"]:
        text += f" Joints are {1e3 * values['lag']['value']:.0f} ms behind their commands."
    if "acting" in values:
        name, acting = min(
            values["acting"]["with_velocity"].items(), key=lambda item: float(item[1]["tracking"]["worst"])
        )
        text += (
            f" On the identified plant {name} leaves, when it acts, at most {acting['tracking']['worst']:.0f} % of "
            f"the tracking error from stroke {FIRST} on."
        )
    return text


def find_gains(gap: Gap, loop_delay: LoopDelay) -> Array:
    """(2, J) kp, N m/rad, and kd, N m s/rad, by the rule of :mod:`cmacexp.models.robot_gains`.

    They are those of a loop that is closed at the sampling rate of the log: the least inertia that each joint feels
    takes the place of the lightest foot.
    """
    problem, period = gap.problem, gap.signals.log.period
    rotors = (problem.machine.losses if gap.fitted is None else gap.fitted.values)[:, 0]
    least = np.empty(len(rotors))
    for block, expansion in zip(problem.machine.blocks, problem.expansions, strict=True):
        inverse = np.linalg.inv(expansion.mass + np.diag(rotors[block]))
        least[block] = (1.0 / np.diagonal(inverse, axis1=1, axis2=2)).min(axis=0)
    kd = choose_feedback(loop_delay, period) * least / period
    return np.array([kd / DECAY_TIME, kd])


def advise(gap: Gap) -> list[str]:
    """What follows for learning on this robot, a sentence each."""
    values, left = gap.values, gap.values["left"]
    period, delay = values["period"], values.get("delay", {}).get("value", 0.0)
    loop_delay = LoopDelay(max(0, round(delay / period)))
    lead = loop_delay.count_samples(period) + 1
    kp, kd = find_gains(gap, loop_delay)
    found = [
        f"Lead: {lead} samples of {1e3 * period:.1f} ms (a delay of {1e3 * delay:.1f} ms, and one sample until "
        f"torque shows in the feedback); rate: {derive_rate(lead):.3f} at that lead, by the rule of "
        "`learning.rate=auto`.",
        f"Gains of a loop that is closed at this sampling rate, by rule: kp {kp.min():.3g} to {kp.max():.3g} "
        f"N m/rad, kd {kd.min():.3g} to {kd.max():.3g} N m s/rad; drives that close it by themselves may have more.",
    ]
    if "stroke before" in left:
        phase, state = left["stroke before"]["value"], left["CMAC over angles and velocities"]["value"]
        found.append(
            f"Address what is learnt by {'phase' if phase < state else 'angles and velocities'}: "
            f"{min(phase, state):.1f} % left instead of {max(phase, state):.1f} %."
        )
    if values["gains"]:
        lag = max((1e3 * d / p for p, d in zip(*values["gains"].values(), strict=True) if p > 0.0), default=0.0)
        found.append(f"Feed desired velocities forward: without them up to kd/kp = {lag:.0f} ms of lag remain.")
    best = left[find_best(values)]
    spread = 1.0 + (best["fastest"]["high"] - best["fastest"]["low"]) / 2.0 / max(best["fastest"]["value"], 1e-9)
    torque = [np.sqrt((gap.signals.torque[gap.signals.rows(k)] ** 2).mean()) for k in range(1, gap.signals.count + 1)]
    found.append(
        f"Margin of the guard: resampled, what the best predictor leaves of one stroke varies by a factor of "
        f"{spread:.2f}; the guard acts at {DRIFT_RATIO:g}, {'above' if spread < DRIFT_RATIO else 'within'} that. "
        f"Between the speeds of this log the torque itself varies by {max(torque) / max(min(torque), 1e-12):.2f}: "
        "compare cycles of one speed only."
    )
    return found
