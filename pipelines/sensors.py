"""Imperfect sensors: what Lin & Song 1997 leave "to be investigated further".

``python -m pipelines.sensors`` breaks a force sensor of a walking machine in many ways and at several gains of the
force feedback, with and without fault detection; adds noise to every signal; and delays signals and torques.
"""

import random
from collections.abc import Callable, Sequence
from typing import Any

from cmacexp.cli.study import main
from cmacexp.study import Request, Results, Study, grid
from pipelines import sensors_figures as figures
from pipelines import sensors_measures as measures
from pipelines.sensors_findings import FINDINGS, GAINS, LATENESS, NOISY_GAIN
from pipelines.sensors_measures import (
    BREAK,
    CHECK,
    GAIN,
    LATE,
    LEG,
    NO_CHECK,
    NOISE,
    NONE,
    SHOWN,
    SOUND,
    WALK,
    WATCH,
)

KINDS = {
    "stuck at zero": ("zero", 0.0),
    "stuck at its last reading": ("last", 0.0),
    "stuck at 40 N": ("value", 40.0),
    "10 N too much": ("bias", 10.0),
    "white noise of 20 N": ("noise", 20.0),
}
"""Failures: the kind of fault, and its value in N."""
EARLIEST, LATEST = 12.0, 18.0
"""When a sensor breaks, s: in the fifth or sixth cycle."""
SHOWN_LEG, SHOWN_START, SHOWN_GAIN = 3, 12.2, GAINS[3]
CYCLES, SHOWN_CYCLES = 12, (4, 5, 6)
THIN = "record.every_nth_step=600"
"""Metrics are of every step; of the traces little is kept."""
LEGGED = ("scenario=quadruped", "learning.lead=1", "gait.load_ramp=0.12")
WALKING = (*LEGGED, THIN, f"cycles={CYCLES}")
FEEDFORWARDS = ("cmac", "none")
CHECKS = {NO_CHECK: ["plausibility=none"], CHECK: ["plausibility=force"]}
NOISY = {NONE: [], "force": ["sensors=noisy_force"]}
REAL = "sensors=real"
LEVELS: dict[str, tuple[str, Sequence[float], Sequence[float]]] = {
    "force": ("noise_relative", (0.05, 0.1, 0.2, 0.4), (0.05, 0.1, 0.2, 0.4)),
    "position": ("noise", (1e-4, 3e-4, 1e-3, 3e-3), (1e-5, 3e-5, 1e-4, 3e-4)),
    "velocity": ("noise", (0.003, 0.01, 0.03, 0.1), (0.003, 0.01, 0.03, 0.1)),
    "height": ("noise", (), (1e-6, 1e-5, 1e-4, 1e-3)),
    "tilt": ("noise", (), (1e-6, 1e-5, 1e-4, 1e-3)),
}
"""Signals: the field of their noise, and its levels for one leg and for the quadruped."""


def _gain(value: float) -> list[str]:
    return [f"force_control.elasticity={value}", f"force_control.admittance={value}"]


def _fault(kind: str, value: float, leg: int, start: float) -> list[str]:
    settings = f"kind={kind}", f"value={value}", f"legs=[{leg}]", f"start={start}"
    return ["sensors=force_stuck", *(f"sensors.force.fault.{setting}" for setting in settings)]


def failures() -> dict[str, dict[str, list[str]]]:
    """By kind: a failure of every leg, each at a moment and with a seed of its own, as overrides by name."""
    drawn, found = random.Random(1997), {}
    for name, (kind, value) in KINDS.items():
        moments = {leg: round(drawn.uniform(EARLIEST, LATEST), 3) for leg in (1, 2, 3, 4)}
        found[name] = {f"leg {leg}": _fault(kind, value, leg, start) for leg, start in moments.items()}
    for seed, overrides in enumerate(each for legs in found.values() for each in legs.values()):
        overrides.append(f"seed={seed}")
    return found


def _break(gains: dict[str, list[str]], quick: bool) -> list[Request]:
    """All failures with and without fault detection, the same machines unbroken, and one failure step by step."""
    found = grid(*WALKING, over={"gain": gains, "feedforward": FEEDFORWARDS}, seeded=True, part=SOUND)
    for kind, legs in list(failures().items())[:: 4 if quick else 1]:
        cases = dict(list(legs.items())[: 1 if quick else None])
        for feedforward, step in (("cmac", 1), ("none", 2)):
            over = {"gain": dict(list(gains.items())[::step]), "check": CHECKS, "broken": cases}
            found += grid(*WALKING, f"feedforward={feedforward}", over=over, part=BREAK, kind=kind)
    shown = (*_gain(SHOWN_GAIN), *_fault("zero", 0.0, SHOWN_LEG, SHOWN_START), f"cycles={SHOWN_CYCLES[-1]}")
    return found + grid(*LEGGED, *shown, f"record.cycles={list(SHOWN_CYCLES)}", over={"check": CHECKS}, part=SHOWN)


def _noise(machine: str, common: Sequence[str], place: int, quick: bool) -> list[Request]:
    """A machine without noise, and with every level of noise on every signal."""
    found = grid(*common, seeded=True, part=NOISE, machine=machine, signal=NONE)
    for signal, (field, *levels) in list(LEVELS.items())[: 1 if quick else None]:
        for level in levels[place][2:3] if quick else levels[place]:
            noise = (REAL, f"sensors.{signal}.{field}={level}")
            found += grid(*common, *noise, seeded=True, part=NOISE, machine=machine, signal=signal, level=level)
    return found


def runs(quick: bool) -> list[Request]:
    """All parts."""
    gains = {f"{value:g}": _gain(value) for value in (GAINS[2:3] if quick else GAINS)}
    watched = (*LEGGED, THIN, *_gain(NOISY_GAIN), "plausibility=force", f"cycles={20 if quick else 500}")
    late: dict[str, Any] = {"late": LATENESS, "learning.lead": (1, 2, "auto")}
    return [
        *_break(gains, quick),
        *grid(*watched, over={"signal": NOISY}, seeded=True, part=WATCH),
        *_noise(LEG, ("scenario=one_leg", THIN, "cycles=10"), 0, quick),
        *_noise(WALK, (*WALKING, *_gain(NOISY_GAIN)), 1, quick),
        *grid(*WALKING, over={"gain": gains, "signal": NOISY}, seeded=True, part=GAIN),
        *grid("scenario=one_leg", THIN, f"cycles={60 if quick else 2000}", over=late, seeded=True, part=LATE),
    ]


def values(results: Results) -> dict[str, Any]:
    """Numbers and settings that the page names."""
    broken, watched, late = (results.select(part=part) for part in (BREAK, WATCH, LATE))
    noisy = results.select(part=GAIN, signal="force")
    return {
        "failures": len(broken.select(feedforward="cmac", check=CHECK)) // len(broken.values("gain")),
        "kinds": broken.values("kind"), "cycles": broken.value("cycles"), "ramp": broken.value("gait.load_ramp"),
        "watched_cycles": watched.value("cycles"), "noisy_gain": watched.value(measures.GAIN_KEY),
        "late_cycles": late.value("cycles"), "last": measures.LAST, "felt": measures.FELT,
        "shown_leg": SHOWN_LEG, "shown_gain": SHOWN_GAIN,
        "force_noise": f"{100 * noisy.value('sensors.force.noise_relative'):g} %",
    }  # fmt: skip


def _part(draw: Callable[[Results], Any], **settings: Any) -> Callable[[Results], Any]:
    return lambda results: draw(results.select(settings))


STUDY = Study(
    title="Faulty sensors",
    question="What do failures, noise and delays of sensors do to walking and learning, and what helps?",
    runs=runs,
    measures={"rejected_after": measures.rejected_after, "rejected_sound": measures.rejected_sound},
    findings=FINDINGS,
    figures={
        "failures": _part(figures.draw_failures, part=BREAK),
        "failure": _part(figures.draw_failure, part=SHOWN),
        "noise_leg": _part(figures.draw_noise, part=NOISE, machine=LEG),
        "noise_walk": _part(figures.draw_noise, part=NOISE, machine=WALK),
    },
    tables={
        "gains": figures.table_of_gains,
        "kinds": _part(figures.table_of_kinds, part=BREAK, feedforward="cmac"),
        "force_noise": _part(figures.table_of_force_noise, part=GAIN),
        "late": _part(figures.table_of_lateness, part=LATE),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
