"""Imperfect sensors: what Lin & Song 1997 leave "to be investigated further".

``python -m pipelines.sensors`` breaks a force sensor of a walking machine in many ways and at several gains of the
force feedback, with and without fault detection; adds noise to every signal; and delays signals and torques.
"""

import random
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from cmacexp.data.run import Run
from cmacexp.study import (
    Criterion,
    DataFrame,
    Figure,
    Finding,
    Panel,
    Request,
    Results,
    Series,
    Study,
    at_least,
    at_most,
    draw,
    grid,
)
from cmacexp.study.interval import estimate
from cmacexp.study.quantity import compute_quantity
from cmacexp.study.samples import relative
from cmacexp.study.statements import Limit
from cmacexp.study.tables import cross_tabulate, tabulate
from cmacexp.typing import Array, Mask
from pipelines.common_results import percent, tabulate_ends

SOUND, BREAK, SHOWN, WATCH, NOISE, GAIN, LATE = "sound", "failures", "shown", "watched", "noise", "gains", "late"
"""Parts of the study: column ``part``."""
LEG, WALK = "one leg", "quadruped"
CHECK, NO_CHECK, NONE = "check", "no check", "none"
CHECKS = {NO_CHECK: ["plausibility=none"], CHECK: ["plausibility=force"]}
KINDS = {
    "stuck at zero": ("zero", 0.0),
    "stuck at its last reading": ("last", 0.0),
    "stuck at 40 N": ("value", 40.0),
    "10 N too much": ("bias", 10.0),
    "white noise of 20 N": ("noise", 20.0),
}
"""Failures: the kind of fault, and its value in N."""
GAINS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""P_fn in m/N and V_fn in m/(N s) alike; the first is the scenario's."""
GAIN_KEY, NOISY_GAIN = "force_control.elasticity", GAINS[2]
SHOWN_LEG, SHOWN_GAIN = 3, GAINS[3]
THIN = "record.every_nth_step=600"
"""Metrics are of every step; of the traces little is kept."""
LEGGED = ("scenario=quadruped", "learning.lead=1", "gait.load_ramp=0.12")
WALKING = (*LEGGED, THIN, "cycles=12")
NOISY = {NONE: [], "force": ["sensors=noisy_force"]}
FORCE_NOISE = 0.2
LATENESS = {
    "velocity": ["sensors=real", "sensors.velocity.delay=1"],
    "torque": ["actuator.delay=1"],
    "position": ["sensors=real", "sensors.position.delay=1"],
}
"""What is a sample late."""
FORCE, TORQUE = "force_rmse_cycle", "feedback_rms"
ERRORS = {
    LEG: {"transfer error in y": "transfer_rmse_y", "force error": "force_rmse", "feedback torque": TORQUE},
    WALK: {"tilt": "tilt_max", "force error": FORCE, "feedback torque": TORQUE},
}
"""Metrics that noise may worsen, by machine and name."""
LAST = 3
"""Cycles whose median is an error at the end."""
FELT = 1.5
"""An error or torque that is at least so many times that without noise is felt."""


SIGNALS: dict[str, tuple[str, str, float, Sequence[float], Sequence[float]]] = {
    "force": ("noise_relative", "% of the force", 100.0, (0.05, 0.1, 0.2, 0.4), (0.05, 0.1, 0.2, 0.4)),
    "position": ("noise", "mrad", 1e3, (1e-4, 3e-4, 1e-3, 3e-3), (1e-5, 3e-5, 1e-4, 3e-4)),
    "velocity": ("noise", "rad/s", 1.0, (0.003, 0.01, 0.03, 0.1), (0.003, 0.01, 0.03, 0.1)),
    "height": ("noise", "mm", 1e3, (), (1e-6, 1e-5, 1e-4, 1e-3)),
    "tilt": ("noise", "mrad", 1e3, (), (1e-6, 1e-5, 1e-4, 1e-3)),
}
"""Field of the noise on each signal; the unit shown, with its factor; levels for one leg and for the quadruped."""


def _gain(value: float) -> list[str]:
    return [f"force_control.elasticity={value}", f"force_control.admittance={value}"]


def _fault(kind: str, value: float, leg: int, start: float) -> list[str]:
    settings = f"kind={kind}", f"value={value}", f"legs=[{leg}]", f"start={start}"
    return ["sensors=force_stuck", *(f"sensors.force.fault.{setting}" for setting in settings)]


def failures() -> dict[str, dict[str, list[str]]]:
    """By kind: a failure of every leg, each at a moment and with a seed of its own, as overrides by name."""
    drawn, found = random.Random(1997), {}
    for name, (kind, value) in KINDS.items():
        moments = {leg: round(drawn.uniform(12.0, 18.0), 3) for leg in (1, 2, 3, 4)}  # the fifth or sixth cycle
        found[name] = {f"leg {leg}": _fault(kind, value, leg, start) for leg, start in moments.items()}
    for seed, overrides in enumerate(each for legs in found.values() for each in legs.values()):
        overrides.append(f"seed={seed}")
    return found


def _break(gains: dict[str, list[str]], quick: bool) -> list[Request]:
    """All failures with and without fault detection, the same machines unbroken, and one failure step by step."""
    found = grid(*WALKING, over={"gain": gains, "feedforward": ("cmac", "none")}, seeded=True, part=SOUND)
    for kind, legs in list(failures().items())[:: 4 if quick else 1]:
        cases = dict(list(legs.items())[: 1 if quick else None])
        for feedforward, step in (("cmac", 1), ("none", 2)):
            over = {"gain": dict(list(gains.items())[::step]), "check": CHECKS, "broken": cases}
            found += grid(*WALKING, f"feedforward={feedforward}", over=over, part=BREAK, kind=kind)
    shown = (*_gain(SHOWN_GAIN), *_fault("zero", 0.0, SHOWN_LEG, 12.2), "cycles=6", "record.cycles=[4, 5, 6]")
    return found + grid(*LEGGED, *shown, over={"check": CHECKS}, part=SHOWN)


def _noise(machine: str, common: Sequence[str], quick: bool) -> list[Request]:
    """A machine without noise, and with every level of noise on every signal."""
    found = grid(*common, seeded=True, part=NOISE, machine=machine, signal=NONE)
    for signal, (field, *_, leg, walk) in list(SIGNALS.items())[: 1 if quick else None]:
        levels = leg if machine == LEG else walk
        for level in levels[2:3] if quick else levels:
            noisy = ("sensors=real", f"sensors.{signal}.{field}={level}")
            found += grid(*common, *noisy, seeded=True, part=NOISE, machine=machine, signal=signal, level=level)
    return found


def runs(quick: bool) -> list[Request]:
    """All parts."""
    gains = {f"{value:g}": _gain(value) for value in (GAINS[2:3] if quick else GAINS)}
    watched = (*LEGGED, THIN, *_gain(NOISY_GAIN), "plausibility=force", f"cycles={20 if quick else 500}")
    late: dict[str, Any] = {"late": LATENESS, "learning.lead": (1, 2, "auto")}
    return [
        *_break(gains, quick),
        *grid(*watched, over={"signal": NOISY}, seeded=True, part=WATCH),
        *_noise(LEG, ("scenario=one_leg", THIN, "cycles=10"), quick),
        *_noise(WALK, (*WALKING, *_gain(NOISY_GAIN)), quick),
        *grid(*WALKING, over={"gain": gains, "signal": NOISY}, seeded=True, part=GAIN),
        *grid("scenario=one_leg", THIN, f"cycles={60 if quick else 2000}", over=late, seeded=True, part=LATE),
    ]


def _broken_legs(run: Run) -> Sequence[int]:
    fault = run.config["sensors"].get("force", {}).get("fault", {})
    return fault["legs"] if fault.get("kind", "none") != "none" else ()


def rejected_after(run: Run) -> float:
    """Samples from the failure of a force sensor until it is rejected; infinite if it is not, or none fails."""
    own = [dropped["step"] for dropped in run.manifest["dropped"] if dropped["leg"] in _broken_legs(run)]
    if not own:
        return np.inf
    return float(min(own) - round(run.config["sensors"]["force"]["fault"]["start"] / run.config["sampling_period"]))


def rejected_sound(run: Run) -> float:
    """Number of sound force sensors that are rejected."""
    return float(sum(dropped["leg"] not in _broken_legs(run) for dropped in run.manifest["dropped"]))


def where_sound_walks(results: Results, check: str, gains: Sequence[float]) -> Results:
    """The failures with a controller and a gain with which all machines of part SOUND complete."""
    sound, broken = results.select(part=SOUND), results.select({"part": BREAK, "check": check, GAIN_KEY: list(gains)})

    def walks(feedforward: str, gain: str) -> bool:
        return all(sound.select(feedforward=feedforward, gain=gain).completed)

    return Results([row for row in broken.rows if walks(row.settings["feedforward"], row.settings["gain"])])


def _rejected_in_time(results: Results) -> Mask:
    return where_sound_walks(results, CHECK, GAINS).measure("rejected_after") <= results.run.steps_per_cycle


def worsening(results: Results, metric: str) -> Array:
    """(noisy runs,): a metric at the end over that of the run without noise and with the same seed."""
    noisy = [row for row in results.rows if row.settings["signal"] != NONE]
    return relative(Results(noisy), results.select(signal=NONE), partial(Results.end, name=metric, cycles=LAST))


def torque_first(results: Results) -> list[bool]:
    """Of each run in which noise is felt, whether the feedback torque grows by more than every error."""
    found = []
    for machine, own in results.by("machine").items():
        grown = np.array([worsening(own, metric) for metric in ERRORS[machine].values()])
        felt = grown.max(axis=0) >= FELT
        found += (grown[-1] >= grown.max(axis=0))[felt].tolist()
    return found


FAILURES = [SOUND, BREAK]
MOST = at_least(0.9)
WEAK = f"gains up to {GAINS[-2]:g}"
LEG_NOISE = f"noise of {100 * FORCE_NOISE:g} % on the force"


def _survive(case: str, check: str, gains: Sequence[float], limit: Limit) -> Criterion:
    quantity = "failures after which the machine walks on"
    return percent(quantity, lambda r: where_sound_walks(r, check, gains).completed, limit, case=case, part=FAILURES)


def _rejected(case: str, **of: Any) -> Criterion:
    quantity = "sound sensors that the check rejects in a run"
    return Criterion(quantity, "rejected_sound", at_most(0.0), of=of, case=case)


def _grows(what: str, gains: Sequence[float], limit: Limit) -> Criterion:
    return Criterion(
        "largest feedback torque over that without noise",
        lambda results: np.max([worsening(own, TORQUE) for own in results.by("gain").values()], axis=0),
        limit,
        of={"part": GAIN, GAIN_KEY: list(gains)},
        case=f"gains {what} {NOISY_GAIN:g}",
    )


def _done(late: Any, lead: Any, limit: Limit) -> Criterion:
    name = f"lead {lead}"
    of = {"part": LATE, "late": late, "learning.lead": lead}
    return percent("cycles done of those asked for", "done", limit, None, of, name)


FINDINGS = {
    "unchecked": Finding(
        [
            _survive(f"no check, {WEAK}", NO_CHECK, GAINS[:-1], MOST),
            _survive(f"no check, gain {GAINS[-1]:g}", NO_CHECK, GAINS[-1:], at_most(0.75)),
        ],
        says=f"Without the check the machine walks on after failures with {WEAK}, and often falls with "
        f"{GAINS[-1]:g}: strong force feedback needs it",
    ),
    "checked": Finding(
        [
            _survive("with the check, all gains", CHECK, GAINS, MOST),
            percent("failures that the check detects within a cycle", _rejected_in_time, MOST, part=FAILURES),
        ],
        says="With `plausibility=force` the machine walks on after failures, and they are detected within a cycle",
    ),
    "alarms": Finding(
        [
            _rejected("without noise", part=WATCH, signal=NONE),
            _rejected("with noisy forces", part=WATCH, signal="force"),
            _rejected("in which another one fails", part=BREAK, check=CHECK),
        ],
        says="The check never rejects a sound sensor",
    ),
    "noise_leg": Finding(
        [
            percent(
                "transfer error in y at the end over that of the first cycle",
                f"transfer_rmse_y[-{LAST}:] / transfer_rmse_y[1]",
                at_most(0.25),
                of={"part": NOISE, "machine": LEG, "signal": "force", "level": FORCE_NOISE},
            ),
            Criterion(
                "feedback torque over that without noise",
                partial(worsening, metric=TORQUE),
                at_least(FELT),
                of={"part": NOISE, "machine": LEG, "signal": [NONE, "force"], "level": [None, FORCE_NOISE]},
            ),
        ],
        says=f"With {LEG_NOISE} one leg still learns, with more feedback torque",
    ),
    "torque_first": Finding(
        [
            percent(
                "runs with noise that is felt in which the torque grows by more than any error",
                torque_first,
                at_least(0.8),
                of={"part": NOISE},
            )
        ],
        says="If sensor noise has an effect at all, it raises the feedback torque more than the errors",
    ),
    "noise_gain": Finding(
        [_grows("up to", GAINS[:3], at_most(FELT)), _grows("above", GAINS[3:], at_least(FELT))],
        says=f"Noisy force sensors limit the gain of the quadruped's force feedback to {NOISY_GAIN:g}",
    ),
    "late": Finding(
        [_done(["velocity", "torque"], "auto", MOST), _done(["velocity", "torque"], 1, at_most(0.9))],
        says="A delayed velocity and a delayed torque need one more sample of lead, which "
        "`learning.lead=auto` counts",
    ),
    "late_position": Finding(
        [_done("position", 1, MOST), _done("position", 2, at_most(0.9))],
        says="A delayed position needs no more lead",
    ),
}


def draw_failure(results: Results) -> Figure:
    """Desired, true and measured force of the leg with the broken sensor; the failure, and its detection."""
    panels = []
    for check, own in results.by("check").items():
        run = own.run
        trace = run.trace[run.trace["leg"] == SHOWN_LEG]
        columns = {"desired": "force_desired", "true": "force", "measured": "force_measured"}
        series = [Series(name, trace["time"], trace[column]) for name, column in columns.items()]
        rejected = [dropped["step"] * run.config["sampling_period"] for dropped in run.manifest["dropped"]]
        events = [run.config["sensors"]["force"]["fault"]["start"], *rejected]
        panels.append(Panel(check, "time, s", "force, N", series, x_limits=events))
    return draw(panels, columns=1, height=1.9)


def draw_noise(results: Results) -> Figure:
    """Errors and torque over those without noise, over the level of noise on each signal."""
    panels = []
    for signal, noisy in results.by("signal").items():
        if signal == NONE:
            continue
        levels, (_, unit, factor, *_) = noisy.values("level"), SIGNALS[signal]
        pairs = [results.select(signal=[NONE, signal], level=[None, level]) for level in levels]
        series = [
            Series(name, factor * np.array(levels), [estimate(worsening(pair, metric)).value for pair in pairs])
            for name, metric in ERRORS[results.value("machine")].items()
        ]
        axes = (f"noise, {unit}", "value over that without noise")
        panels.append(Panel(f"noise on the {signal}", *axes, series, log="x", y_limits=[FELT]))
    return draw(panels, columns=3)


def _count_kinds(results: Results) -> str:
    without, checked = (sum(results.select(check=check).completed) for check in (NO_CHECK, CHECK))
    return f"{without}, {checked} of {len(results.select(check=CHECK))}"


def _force_noise(results: Results) -> DataFrame:
    return tabulate(
        results.select(part=GAIN),
        {"gain": "gain", "signal": "noise on"},
        {
            "force error, N": partial(Results.end, name=FORCE, cycles=LAST),
            "feedback torque, N m": partial(Results.end, name=TORQUE, cycles=LAST),
            "tilt, mrad": partial(compute_quantity, f"1e3 * tilt_max[-{LAST}:]"),
        },
    )


def values(results: Results) -> dict[str, Any]:
    """Numbers and settings that the page names."""
    broken, watched, late = (results.select(part=part) for part in (BREAK, WATCH, LATE))
    noise = results.select(part=GAIN, signal="force").value("sensors.force.noise_relative")
    return {
        "failures": len(broken.select(feedforward="cmac", check=CHECK)) // len(broken.values("gain")),
        "kinds": broken.values("kind"), "cycles": broken.value("cycles"), "ramp": broken.value("gait.load_ramp"),
        "watched_cycles": watched.value("cycles"), "noisy_gain": watched.value(GAIN_KEY),
        "late_cycles": late.value("cycles"), "last": LAST, "felt": FELT, "shown_leg": SHOWN_LEG,
        "shown_gain": SHOWN_GAIN, "force_noise": f"{100 * noise:g} %",
    }  # fmt: skip


STUDY = Study(
    title="Faulty sensors",
    question="What do failures, noise and delays of sensors do to walking and learning, and what helps?",
    runs=runs,
    measures={"rejected_after": rejected_after, "rejected_sound": rejected_sound},
    findings=FINDINGS,
    figures={
        "failure": lambda r: draw_failure(r.select(part=SHOWN)),
        "noise_leg": lambda r: draw_noise(r.select(part=NOISE, machine=LEG)),
        "noise_walk": lambda r: draw_noise(r.select(part=NOISE, machine=WALK)),
    },
    tables={
        "kinds": lambda r: cross_tabulate(
            r.select(part=BREAK, feedforward="cmac"), ("kind", "failure"), ("gain", "gain"), _count_kinds
        ),
        "force_noise": _force_noise,
        "late": tabulate_ends(
            f"1e3 * transfer_rmse_y[-{LAST}:]", ("late", "late"), ("learning.lead", "lead"), {"part": LATE}
        ),
    },
    values=values,
)
