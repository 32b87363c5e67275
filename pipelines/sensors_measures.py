"""What the study of sensors measures: rejected sensors, and errors under noise over those without."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.study import Results
from cmacexp.study.samples import relative
from cmacexp.typing import Array

SOUND, BREAK, SHOWN, WATCH = "sound", "failures", "shown", "watched"
NOISE, GAIN, LATE = "noise", "gains", "late"
"""Parts of the study: column ``part``."""
LEG, WALK = "one leg", "quadruped"
CHECK, NO_CHECK, NONE = "check", "no check", "none"
GAIN_KEY = "force_control.elasticity"
LAST = 3
"""Cycles whose median is an error at the end."""
FELT = 1.5
"""An error or torque that is at least so many times that without noise is felt."""
ERRORS: Mapping[str, Mapping[str, str]] = {
    LEG: {"transfer error in y": "transfer_rmse_y", "force error": "force_rmse", "feedback torque": "feedback_rms"},
    WALK: {"tilt": "tilt_max", "force error": "force_rmse_cycle", "feedback torque": "feedback_rms"},
}
"""Metrics that noise may worsen, by machine and name."""


def _fault(run: StoredRun) -> Mapping[str, Any]:
    """The fault of the force sensors; without legs if there is none."""
    fault: Mapping[str, Any] = run.config["sensors"].get("force", {}).get("fault", {})
    return fault if fault.get("kind", "none") != "none" else {"legs": []}


def rejected_after(run: StoredRun) -> float:
    """Samples from the failure of a force sensor until it is rejected; infinite if it is not, or none fails."""
    fault, period = _fault(run), run.config["sampling_period"]
    own = [dropped["step"] for dropped in run.manifest["dropped"] if dropped["leg"] in fault["legs"]]
    return float(min(own) - round(fault["start"] / period)) if own else np.inf


def rejected_sound(run: StoredRun) -> float:
    """Number of sound force sensors that are rejected."""
    return float(sum(dropped["leg"] not in _fault(run)["legs"] for dropped in run.manifest["dropped"]))


def end(results: Results, metric: str) -> Array:
    """(runs,): a metric at the end; infinite of a run that ended before."""
    return results.end(metric, LAST)


def survivals(results: Results, check: str, gains: Sequence[float]) -> list[bool]:
    """Of each failure, with CMAC and without, whether the machine walks on; where it walks with sound sensors."""
    return [done for broken in _where_sound_walks(results, check, gains) for done in broken.completed]


def rejected_in_time(results: Results, gains: Sequence[float]) -> list[bool]:
    """Of each such failure: whether the check rejects the sensor within a cycle."""
    found = []
    for broken in _where_sound_walks(results, CHECK, gains):
        found += (broken.measure("rejected_after") <= broken.run.steps_per_cycle).tolist()
    return found


def _where_sound_walks(results: Results, check: str, gains: Sequence[float]) -> list[Results]:
    """The failures of each controller and gain with which all machines of part SOUND complete."""
    broken = results.select({"part": BREAK, "check": check, GAIN_KEY: list(gains)})
    found = []
    for feedforward, own in broken.by("feedforward").items():
        for gain, failures in own.by("gain").items():
            if all(results.select(part=SOUND, gain=gain, feedforward=feedforward).completed):
                found.append(failures)
    return found


def worsening(results: Results, metric: str) -> Array:
    """(noisy runs,): a metric at the end over that of the run without noise and with the same seed."""
    noisy = [row for row in results.rows if row.settings["signal"] != NONE]
    return relative(Results(noisy), results.select(signal=NONE), partial(end, metric=metric))


def torque_first(results: Results) -> list[bool]:
    """Of each run in which noise is felt: whether the feedback torque grows by more than every error."""
    found = []
    for machine, own in results.by("machine").items():
        grown = np.array([worsening(own, metric) for metric in ERRORS[machine].values()])
        felt = grown.max(axis=0) >= FELT
        found += (grown[-1] >= grown.max(axis=0))[felt].tolist()
    return found
