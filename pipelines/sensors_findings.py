"""Claims and findings of the study of sensors, and the runs that decide them."""

from functools import partial
from typing import Any

import numpy as np

from cmacexp.study import Criterion, Finding, Results, at_least, at_most
from cmacexp.study.samples import per_seed, relative, share_done
from cmacexp.typing import Array
from pipelines import sensors_measures as measures
from pipelines.sensors_measures import (
    BREAK,
    CHECK,
    FELT,
    GAIN,
    GAIN_KEY,
    LATE,
    LEG,
    NO_CHECK,
    NOISE,
    NONE,
    SOUND,
)

GAINS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""P_fn in m/N and V_fn in m/(N s) alike; the first is the scenario's."""
NOISY_GAIN = GAINS[2]
FORCE_NOISE = 0.2
NOISY = f"{100 * FORCE_NOISE:g} %"
LATENESS = {
    "velocity": ["sensors=real", "sensors.velocity.delay=1"],
    "torque": ["actuator.delay=1"],
    "position": ["sensors=real", "sensors.position.delay=1"],
}
"""What is a sample late."""
COUNTED = list(LATENESS)[:2]
PERCENT: dict[str, Any] = {"unit": "%", "scale": 100.0}
MOST = at_least(0.9)
FAILURES = {"part": [SOUND, BREAK]}


def _survive(what: str, check: str, gains: tuple[float, ...], limit: Any) -> Criterion:
    sample = partial(measures.survivals, check=check, gains=gains)
    return Criterion(f"failures after which the machine walks on, {what}", sample, limit, **PERCENT, of=FAILURES)


def _error_left(results: Results) -> Array:
    """(seeds,): transfer error at the end over that of the first cycle, one leg with noise on the force."""
    return measures.end(results, "transfer_rmse_y") / results.at(1, "transfer_rmse_y")


def _torque_grows(results: Results) -> Array:
    """(seeds,): feedback torque over that without noise, the largest over the gains."""
    noisy, sound = results.select(signal="force"), results.select(signal=NONE)
    ratios = [
        relative(own, sound.select(gain=gain), partial(measures.end, metric="feedback_rms"))
        for gain, own in noisy.by("gain").items()
    ]
    return per_seed(noisy, np.concatenate(ratios), max)


def _done(what: str, limit: Any, late: Any, lead: Any) -> Criterion:
    of = {"part": LATE, "late": late, "learning.lead": lead}
    return Criterion(f"cycles done of those asked for, {what}", share_done, limit, **PERCENT, of=of)


FINDINGS = {
    "unchecked": Finding(
        [
            _survive(f"no check, gains up to {GAINS[-2]:g}", NO_CHECK, GAINS[:-1], MOST),
            _survive(f"no check, gain {GAINS[-1]:g}", NO_CHECK, GAINS[-1:], at_most(0.75)),
        ],
        yes=f"Without the check the machine walks on after {{value}} of the failures with gains up to {GAINS[-2]:g}, "
        f"and after {{values[1]}} with {GAINS[-1]:g}: strong force feedback needs the check.",
        no=f"The gain does not decide which failures are survived without the check: {{value}} with gains up to "
        f"{GAINS[-2]:g}, {{values[1]}} with {GAINS[-1]:g}.",
        unclear=f"More failures are needed: without the check {{value}} are survived with gains up to {GAINS[-2]:g}, "
        f"and {{values[1]}} with {GAINS[-1]:g}.",
    ),
    "checked": Finding(
        [
            _survive("with the check, all gains", CHECK, GAINS, MOST),
            Criterion(
                "failures that the check detects within a cycle",
                partial(measures.rejected_in_time, gains=GAINS),
                MOST,
                **PERCENT,
                of=FAILURES,
            ),
        ],
        yes="With `plausibility=force` the machine walks on after {value} of the failures over all gains; "
        "{values[1]} are detected within a cycle.",
        no="`plausibility=force` is no remedy for all failures: the machine walks on after {value}; {values[1]} are "
        "detected within a cycle.",
        unclear="More failures are needed: with `plausibility=force` the machine walks on after {value}; {values[1]} "
        "are detected within a cycle.",
    ),
    "alarms": Finding(
        [
            Criterion(
                f"sound sensors that the check rejects in all runs{what}",
                lambda results: [results.measure("rejected_sound").sum()],
                at_most(0.0),
                of=of,
            )
            for what, of in (
                (" without noise", {"part": measures.WATCH, "signal": NONE}),
                (" with noisy forces", {"part": measures.WATCH, "signal": "force"}),
                (" in which another one fails", {"part": BREAK, "check": CHECK}),
            )
        ],
        yes="The check rejects no sound sensor.",
        no="The check rejects sound sensors: {value} without noise, {values[1]} with noisy forces, and {values[2]} "
        "beside a broken sensor.",
        unclear="Whether the check rejects sound sensors is not settled: {value} without noise, {values[1]} with "
        "noisy forces, and {values[2]} beside a broken sensor.",
    ),
    "noise_leg": Finding(
        [
            Criterion(
                "transfer error in y at the end over that of the first cycle",
                _error_left,
                at_most(0.25),
                **PERCENT,
                of={"part": NOISE, "machine": LEG, "signal": "force", "level": FORCE_NOISE},
            ),
            Criterion(
                "feedback torque over that without noise",
                partial(measures.worsening, metric="feedback_rms"),
                at_least(FELT),
                of={"part": NOISE, "machine": LEG, "signal": [NONE, "force"], "level": [None, FORCE_NOISE]},
            ),
        ],
        yes=f"With noise of {NOISY} on the force one leg still learns: its transfer error in y ends at {{value}} of "
        "that of the first cycle; its feedback torque is {values[1]} times that without noise.",
        no=f"Noise of {NOISY} on the force either keeps one leg from learning ({{value}} of its first error "
        "is left) or is not felt in the torque ({values[1]} times that without).",
        unclear=f"What noise of {NOISY} on the force does to one leg differs between seeds.",
    ),
    "torque_first": Finding(
        [
            Criterion(
                "runs with noise that is felt in which the torque grows by more than any error",
                measures.torque_first,
                at_least(0.8),
                **PERCENT,
                of={"part": NOISE},
            )
        ],
        yes="Where noise is felt, the feedback torque grows by more than the errors: in {value} of the runs.",
        no="Where noise is felt, the feedback torque does not in general grow by more than the errors: it does in "
        "{value} of the runs.",
        unclear="Where noise is felt, the feedback torque grows by more than the errors in {value} of the runs; "
        "more runs are needed.",
    ),
    "noise_gain": Finding(
        [
            Criterion(
                f"feedback torque over that without noise, gains up to {NOISY_GAIN:g}, the largest",
                _torque_grows,
                at_most(FELT),
                of={"part": GAIN, GAIN_KEY: list(GAINS[:3])},
            ),
            Criterion(
                f"feedback torque over that without noise, gains above {NOISY_GAIN:g}, the largest",
                _torque_grows,
                at_least(FELT),
                of={"part": GAIN, GAIN_KEY: list(GAINS[3:])},
            ),
        ],
        yes=f"Noisy force sensors limit the gain: up to {NOISY_GAIN:g} noise multiplies the quadruped's feedback "
        "torque by {value} at most, above it by up to {values[1]}.",
        no=f"A gain of {NOISY_GAIN:g} does not separate where noise on the forces is felt: up to it the feedback "
        "torque is {value} times that without noise, above it up to {values[1]} times.",
        unclear="Above which gain noise on the forces is felt differs between seeds.",
    ),
    "late": Finding(
        [
            _done("auto", MOST, COUNTED, "auto"),
            _done("lead 1", at_most(0.9), COUNTED, 1),
        ],
        yes="A late velocity and a late torque need one more sample of lead, which `learning.lead=auto` counts: with "
        "lead 1 runs end after {values[1]} of their cycles.",
        no="A late velocity or torque does not need just one more sample of lead: with `learning.lead=auto` runs "
        "complete {value} of their cycles, with lead 1 {values[1]}.",
        unclear="Whether a late velocity and a late torque need one more sample of lead differs between seeds.",
    ),
    "late_position": Finding(
        [_done("lead 1", MOST, "position", 1), _done("lead 2", at_most(0.9), "position", 2)],
        yes="A late position needs no more lead: with lead 1 runs last, with lead 2 they end after {values[1]} of "
        "their cycles.",
        no="A late position does not call for lead 1: with it runs complete {value} of their cycles, with lead 2 "
        "{values[1]}.",
        unclear="Which lead a late position needs differs between seeds.",
    ),
}
