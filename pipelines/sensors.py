"""Imperfect sensors, which Lin & Song 1997 leave "to be investigated further".

``python -m pipelines.sensors`` simulates failures of a force sensor of the walking machine at several gains of the
force feedback, with and without fault detection; adds noise to every signal; and delays signals and torques.
"""

import random
from functools import partial

import numpy as np

from cmacexp.study import (
    Array,
    Declared,
    Results,
    Run,
    completed,
    compute_growth,
    declare,
    of_completed,
    relative,
)
from pipelines.common_results import describe_end

KINDS = {
    "stuck at zero": ("zero", 0.0),
    "stuck at its last reading": ("last", 0.0),
    "stuck at 40 N": ("value", 40.0),
    "10 N too much": ("bias", 10.0),
    "white noise of 20 N": ("noise", 20.0),
}
"""Failures: the kind of fault, and its value in N."""
GAINS = {
    gain: [f"force_control.elasticity={gain}", f"force_control.admittance={gain}"]
    for gain in ("0.0001", "0.0003", "0.001", "0.003", "0.01")
}
"""Gains of the force feedback, P_fn in m/N and V_fn in m/(N s) with the same value; the first is the scenario's."""
CHECKS = {"no check": ["plausibility=none"], "check": ["plausibility=force"]}
NOISY = {"none": [], "force": ["sensors=noisy_force"]}
THIN = "record.every_nth_step=600"
"""Override that thins the recorded traces; metrics use every step."""
LEGGED = ["scenario=quadruped", "learning.lead=1", "gait.load_ramp=0.12"]
WALKING = [*LEGGED, THIN, "cycles=12"]
LEG, WALK = "one leg", "quadruped"
LATE = 3
"""Number of last cycles over which final values are computed."""
ERRORS = {
    LEG: {"transfer error in y": "transfer_rmse_y", "force error": "force_rmse", "feedback torque": "feedback_rms"},
    WALK: {"tilt": "tilt_max", "force error": "force_rmse_cycle", "feedback torque": "feedback_rms"},
}
"""Metrics that noise may increase, by machine and name."""
SIGNALS: dict[str, tuple[str, tuple[float, ...], tuple[float, ...]]] = {
    "force": ("noise_relative", (0.05, 0.1, 0.2, 0.4), (0.05, 0.1, 0.2, 0.4)),
    "position": ("noise", (1e-4, 3e-4, 1e-3, 3e-3), (1e-5, 3e-5, 1e-4, 3e-4)),
    "velocity": ("noise", (0.003, 0.01, 0.03, 0.1), (0.003, 0.01, 0.03, 0.1)),
    "height": ("noise", (), (1e-6, 1e-5, 1e-4, 1e-3)),
    "tilt": ("noise", (), (1e-6, 1e-5, 1e-4, 1e-3)),
}
"""Config field of the noise on each signal; noise levels for one leg, which has no body, and for the quadruped."""


def _break(kind: str, value: float, leg: int, start: float) -> list[str]:
    settings = f"kind={kind}", f"value={value}", f"legs=[{leg}]", f"start={start}"
    return ["sensors=force_stuck", *(f"sensors.force.fault.{setting}" for setting in settings)]


def _draw_failures() -> list[Declared]:
    """Return runs with failures of every kind and leg, with and without fault detection.

    Each failure starts at a random time and has its own seed.
    """
    generator = random.Random(1997)
    declared = []
    for number, (name, (kind, value)) in enumerate(KINDS.items()):
        moments = {leg: round(generator.uniform(12.0, 18.0), 3) for leg in (1, 2, 3, 4)}  # the fifth or sixth cycle
        broken = {
            f"leg {leg}": [*_break(kind, value, leg, start), f"seed={4 * number + leg - 1}"]
            for leg, start in moments.items()
        }
        declared += [
            {
                "set": [*WALKING, f"feedforward={feedforward}"],
                "over": {"gain": dict(list(GAINS.items())[::step]), "check": CHECKS, "broken": broken},
                "labels": {"part": "failures", "kind": name},
                "quick": {"cycles": 6} if name == "stuck at zero" else None,
            }
            for feedforward, step in (("cmac", 1), ("none", 2))
        ]
    return declared


def _add_noise(machine: str, words: list[str], column: int) -> list[Declared]:
    """Return runs of a machine without noise, and with every level of noise on every signal.

    ``words`` are its overrides; ``column`` is the index of its noise levels in SIGNALS: 0 for one leg, 1 for the
    quadruped.
    """
    sound: Declared = {"set": words, "seeds": True, "labels": {"part": "noise", "machine": machine, "signal": "none"}}
    noisy = [
        {
            **sound,
            "over": {"level": {n: ["sensors=real", f"sensors.{signal}.{field}={n}"] for n in levels[column]}},
            "labels": {**sound["labels"], "signal": signal},
            "quick": {} if signal == "force" else None,
        }
        for signal, (field, *levels) in SIGNALS.items()
        if levels[column]
    ]
    return [sound, *noisy]


def _find_fault(run: Run) -> Declared:
    """Return the declared fault of the force sensors of a run; one without legs if there is none."""
    fault = run.config["sensors"].get("force", {}).get("fault", {})
    return dict(fault) if fault.get("kind", "none") != "none" else {"legs": [], "start": 0.0}


def rejected_after(run: Run) -> float:
    """Count the samples from the failure of a force sensor until its rejection; infinite if it is not rejected."""
    fault = _find_fault(run)
    steps = [dropped["step"] for dropped in run.manifest["dropped"] if dropped["leg"] in fault["legs"]]
    return float(min(steps, default=np.inf) - round(fault["start"] / run.config["sampling_period"]))


def rejected_sound(run: Run) -> float:
    """Count the working force sensors that are rejected in a run."""
    return float(sum(dropped["leg"] not in _find_fault(run)["legs"] for dropped in run.manifest["dropped"]))


def where_sound_walks(results: Results, check: str, gains: list[str]) -> Results:
    """Select the runs with a failure whose feedforward and gain let all runs with working sensors complete."""
    broken = results.select(part="failures", check=check, gain=list(gains))
    walks = {
        (name, gain)
        for name, runs in results.select(part="sound").by("feedforward").items()
        for gain, repetitions in runs.by("gain").items()
        if all(repetitions.completed)
    }
    return Results([row for row in broken.rows if (row.settings["feedforward"], row.settings["gain"]) in walks])


def _end_torque(results: Results) -> Array:
    """Return the RMS feedback torque over the last 3 cycles, N m, (runs,)."""
    return results.end("feedback_rms", LATE)


def worsening(results: Results) -> Array:
    """Return the final feedback torque relative to the run without noise and with the same seed, (noisy runs,)."""
    return relative(results.select(signal="force"), results.select(signal="none"), _end_torque)


def _count_kinds(results: Results) -> str:
    without, checked = (sum(results.select(check=check).completed) for check in CHECKS)
    return f"{without}, {checked} of {len(results.select(check='check'))}"


def _survive(case: str, check: str, gains: list[str], limit: str) -> Declared:
    return {
        "quantity": "failures after which the machine walks on",
        "value": lambda results: where_sound_walks(results, check, gains).completed,
        "of": {"part": ["sound", "failures"]},
        "case": case,
        "limit": limit,
    }


REJECTED: Declared = {
    "quantity": "sound sensors that the check rejects in a run", "limit": "at most 0",
    "value": lambda runs: runs.measure("rejected_sound"),
}  # fmt: skip
DONE: Declared = {"quantity": "cycles done of those asked for", "value": lambda runs: runs.done}
STUDY = declare(
    title="Faulty sensors",
    question="What do failures, noise and delays of sensors do to walking and learning, and what helps?",
    runs=[
        {"set": WALKING, "over": {"gain": GAINS, "feedforward": ["cmac", "none"]}, "seeds": True,
         "labels": {"part": "sound"}},
        *_draw_failures(),
        {"set": [*LEGGED, *GAINS["0.003"], *_break("zero", 0.0, 3, 12.2), "cycles=6", "record.cycles=[4, 5, 6]"],
         "over": {"check": CHECKS}, "labels": {"part": "shown"}},
        {"set": [*LEGGED, THIN, *GAINS["0.001"], "plausibility=force", "cycles=500"], "quick": {"cycles": 20},
         "over": {"signal": NOISY}, "seeds": True, "labels": {"part": "watched"}},
        *_add_noise(LEG, ["scenario=one_leg", THIN, "cycles=10"], 0),
        *_add_noise(WALK, [*WALKING, *GAINS["0.001"]], 1),
        {"set": WALKING, "over": {"gain": GAINS, "signal": NOISY}, "seeds": True, "labels": {"part": "gains"}},
        {"set": ["scenario=one_leg", THIN, "cycles=2000"], "quick": {"cycles": 60}, "seeds": True,
         "over": {
             "late": {
                 "velocity": ["sensors=real", "sensors.velocity.delay=1"],
                 "torque": ["actuator.delay=1"],
                 "position": ["sensors=real", "sensors.position.delay=1"],
             },
             "learning.lead": [1, 2, "auto"],
         },
         "labels": {"part": "late"}},
    ],
    measures={"rejected_after": rejected_after, "rejected_sound": rejected_sound},
    findings={
        "unchecked": {
            "says": "Without the check the machine walks on after failures with gains up to 0.003, and often falls "
            "with 0.01: strong force feedback needs it",
            "criteria": [
                _survive("no check, gains up to 0.003", "no check", [*GAINS][:-1], "at least 90 %"),
                _survive("no check, gain 0.01", "no check", ["0.01"], "at most 75 %"),
            ],
        },
        "checked": {
            "says": "With `plausibility=force` the machine walks on after failures, and they are detected within a "
            "cycle",
            "criteria": [
                _survive("with the check, all gains", "check", [*GAINS], "at least 90 %"),
                {"quantity": "failures that the check detects within a cycle", 
                 "value": lambda results: where_sound_walks(results, "check", [*GAINS]).measure("rejected_after")
                 <= results.run.steps_per_cycle,
                 "of": {"part": ["sound", "failures"]}, "limit": "at least 90 %"},
            ],
        },
        "alarms": {
            "says": "The check never rejects a sound sensor",
            "criteria": [
                {**REJECTED, "of": {"part": "watched", "signal": "none"}, "case": "without noise"},
                {**REJECTED, "of": {"part": "watched", "signal": "force"}, "case": "with noisy forces"},
                {**REJECTED, "of": {"part": "failures", "check": "check"}, "case": "in which another one fails"},
            ],
        },
        "noise_leg": {
            "says": "With noise of 20 % on the force one leg still learns, with more feedback torque",
            "criteria": [
                {"quantity": "transfer error in y at the end over that of the first cycle",
                 "value": lambda runs: compute_growth(
                     runs.end("transfer_rmse_y", LATE), runs.at(1, "transfer_rmse_y")
                 ), "limit": "at most 25 %",
                 "of": {"part": "noise", "machine": LEG, "signal": "force", "level": 0.2}},
                {"quantity": "feedback torque over that without noise", "value": _end_torque,
                 "of": {"part": "noise", "machine": LEG, "signal": "force", "level": 0.2},
                 "over": {"signal": "none", "level": None}, "limit": "at least 1.5"},
            ],
        },
        "noise_gain": {
            "says": "Noisy force sensors limit the gain of the quadruped's force feedback to 0.001",
            "criteria": [
                {"quantity": "largest feedback torque over that without noise", 
                 "value": lambda all: np.max([worsening(runs) for runs in all.by("gain").values()], axis=0),
                 "of": {"part": "gains", "gain": gains}, "case": f"gains {what} 0.001", "limit": limit}
                for what, gains, limit in (
                    ("up to", [*GAINS][:3], "at most 1.5"), ("above", [*GAINS][3:], "at least 1.5"),
                )
            ],
        },
        "late": {
            "says": "A delayed velocity and a delayed torque need one more sample of lead, which "
            "`learning.lead=auto` counts",
            "criteria": [
                {**DONE, "of": {"part": "late", "late": ["velocity", "torque"], "learning.lead": lead},
                 "case": f"lead {lead}", "limit": limit}
                for lead, limit in (("auto", "at least 90 %"), (1, "at most 90 %"))
            ],
        },
        "late_position": {
            "says": "A delayed position needs no more lead",
            "criteria": [
                {**DONE, "of": {"part": "late", "late": "position", "learning.lead": lead}, "case": f"lead {lead}",
                 "limit": limit}
                for lead, limit in ((1, "at least 90 %"), (2, "at most 90 %"))
            ],
        },
    },
    figures={
        "failure": {"metric": "force_rmse_cycle", "by": "check", "of": {"part": "shown"}, "title": "force error"},
        **{
            f"noise_{name}": [
                {"value": partial(Results.end, name=metric, cycles=LATE), "over": "level", "by": "signal",
                 "log": "xy", "title": title,
                 "y": f"{title}, SI units", "of": {"part": "noise", "machine": machine, "signal": list(SIGNALS)}}
                for title, metric in ERRORS[machine].items()
            ]
            for name, machine in (("leg", LEG), ("walk", WALK))
        },
    },
    tables={
        "kinds": {
            "rows": {"kind": "failure"}, "across": {"gain": "gain"}, "value": _count_kinds,
            "of": {"part": "failures", "feedforward": "cmac"},
        },
        "force_noise": {
            "rows": {"gain": "gain", "signal": "noise on"},
            "columns": {
                **of_completed({
                    "force error, N": lambda runs: runs.end("force_rmse_cycle", LATE),
                    "feedback torque, N m": _end_torque,
                    "tilt, mrad": lambda runs: 1e3 * runs.end("tilt_max", LATE),
                }),
                "completed": completed,
            },
            "of": {"part": "gains"},
        },
        "late": {
            "rows": "late", "across": {"learning.lead": "lead"}, "of": {"part": "late"},
            "value": partial(describe_end, quantity=lambda runs: 1e3 * runs.end("transfer_rmse_y", LATE)),
        },
    },
)  # fmt: skip
