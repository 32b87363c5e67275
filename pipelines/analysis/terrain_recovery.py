"""Learning after a change of ground or load: how far errors rise, and how many cycles they take to recover."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Drawing, Part, Section, Table, Text
from pipelines.analysis import figures_terrain as figures
from pipelines.analysis.measured import digits
from pipelines.analysis.terrain_measures import BODY, FEEDFORWARDS, LASTING, Measure, errors_of
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs

if TYPE_CHECKING:
    pass

CYCLE_TIME = 3.0
"""T of both scenarios, s."""
FACTOR, PAYLOAD, AHEAD = 3, 10, 0.1
"""Step of the ground's stiffness, weight of the payload in N, and how far ahead of the centre it may lie, m."""
WITHIN = 1.2
"""An error that stays within this factor of a level has recovered."""
CYCLES_OF_LEVEL = 5
"""Cycles before the change, or at the end, whose mean is a level."""


LEG = {
    "transfer_rmse_x": Measure("transfer error x", 1e3, "mm"),
    "transfer_rmse_y": Measure("transfer error y", 1e3, "mm"),
    "force_rmse": Measure("force error in support", 1.0, "N"),
}


class Change(NamedTuple):
    """Something that happens to a machine."""

    words: str
    scenario: list[str]
    overrides: str
    """What sets it, ``{}`` in the place of its time in s."""
    measures: Mapping[str, Measure]


_STEP = f"terrain.step_factor={FACTOR} terrain.step_time={{}}"
_LEG = ["scenario=one_leg", "reference=aware", "learning.lead=1"]
_WALK = ["scenario=quadruped", *LASTING]
CHANGES = {
    "leg": Change(f"one leg, ground {FACTOR} times as stiff", _LEG, _STEP, LEG),
    "stiff": Change(f"quadruped, ground {FACTOR} times as stiff", _WALK, _STEP, BODY),
    "payload": Change(
        f"quadruped, {PAYLOAD} N on its centre", _WALK, f"payload.weight={PAYLOAD} payload.time={{}}", BODY
    ),
    "ahead": Change(
        f"quadruped, {PAYLOAD} N {AHEAD:g} m ahead of its centre",
        _WALK,
        f"payload.weight={PAYLOAD} payload.x={AHEAD} payload.time={{}}",
        BODY,
    ),
}


class Recovery(NamedTuple):
    """An error around a change."""

    before: float
    """Level before it."""
    worst: float
    """Largest value since."""
    end: float
    """Level at the end."""
    to_before: int | None
    """Cycles until it stays within WITHIN times the level before; None: never."""
    to_end: int
    """Cycles until it stays within WITHIN times the level at the end."""


def recovery(errors: np.ndarray, change: int) -> Recovery:
    """How an error (cycles,) comes back after the first ``change`` cycles; 0 cycles where it never left.

    >>> recovery(np.array([1.0] * 5 + [8.0, 4.0, 1.1] + [1.0] * 5), 5)
    Recovery(before=1.0, worst=8.0, end=1.0, to_before=2, to_end=2)
    >>> recovery(np.array([1.0] * 5 + [8.0, 4.0, 2.3] + [2.0] * 5), 5).to_before is None
    True
    """
    before, end = float(errors[:change][-CYCLES_OF_LEVEL:].mean()), float(errors[-CYCLES_OF_LEVEL:].mean())
    since = errors[change:]

    def until(level: float) -> int | None:
        outside = np.flatnonzero(~(since <= WITHIN * level))
        cycles = int(outside[-1]) + 1 if len(outside) else 0
        return cycles if cycles < len(since) else None

    to_end = until(end)
    return Recovery(before, float(since.max()), end, until(before), len(since) if to_end is None else to_end)


def cycles_of(quick: bool) -> tuple[int, int]:
    """Cycles before the change, and in all."""
    return (12, 24) if quick else (40, 100)


def jobs(quick: bool) -> Jobs:
    """Every change with and without CMAC."""
    change, cycles = cycles_of(quick)
    return {
        f"{key}, {words}": [
            *each.scenario,
            f"feedforward={feedforward}",
            f"cycles={cycles}",
            "record.cycles=[1]",
            *each.overrides.format(change * CYCLE_TIME).split(),
        ]
        for key, each in CHANGES.items()
        for words, feedforward in FEEDFORWARDS.items()
    }


def change_cycle(run: StoredRun) -> int:
    """Cycles before the change of a run."""
    step = run.config["terrain"]["step_time"]
    return round((run.config["payload"]["time"] if step is None else step) / CYCLE_TIME)


def recoveries(run: StoredRun, names: Mapping[str, Measure]) -> dict[str, Recovery]:
    """By the names of the measures; nothing for a run that did not complete."""
    if run.status != "completed":
        return {}
    errors = errors_of(run, names)
    return {name: recovery(errors[name].to_numpy(), change_cycle(run)) for name in names}


def _rows(runs: Runs) -> list[list[str]]:
    rows = []
    for key, change in CHANGES.items():
        for words in FEEDFORWARDS:
            run = runs[f"{key}, {words}"]
            if run.status != "completed":
                rows.append([change.words, words, run.status, *["-"] * 5])
            for name, found in recoveries(run, change.measures).items():
                measure = change.measures[name]
                back = "never" if found.to_before is None else str(found.to_before)
                levels = (digits(value) for value in (found.before, found.worst, found.end))
                rows.append(
                    [change.words, words, f"{measure.words}, {measure.unit}", *levels, back, str(found.to_end)]
                )
    return rows


def advice(runs: Runs) -> str:
    """What follows from the force errors and the transfer errors of the changes."""
    slowest, raised, better = 0, [], []
    for key, change in CHANGES.items():
        own = {words: recoveries(runs[f"{key}, {words}"], change.measures) for words in FEEDFORWARDS}
        force = next(name for name in change.measures if name.startswith("force"))
        learned, alone = own["with CMAC"], own["feedback alone"]
        if not learned:
            ends = runs[f"{key}, with CMAC"].status
            return f"Do not count on learning through every change: {change.words} ends {ends}."
        slowest = max(slowest, *(found.to_end for found in learned.values()))
        if learned[force].to_before is None:
            raised.append(f"{change.words} ({digits(learned[force].before)} to {digits(learned[force].end)} N)")
        better.append(not alone or learned[force].end < alone[force].end)
    said = f"Leave learning on: after every change all errors are within {slowest} cycles at their new level"
    said += ", and the force error is below that of feedback alone" if all(better) else ""
    if raised:
        said += (
            "; but the plan still assumes the old ground and weight, so the force stays wrong: "
            + ", ".join(raised)
            + ". Where the force matters, give the plan the new values (terrain.assumed_stiffness, machine.weight)"
        )
    return said + "."


def section(runs: Runs) -> Section:
    """The changes, a table and advice."""
    walks = {key: change for key, change in CHANGES.items() if change.measures is BODY}
    of_walks = {
        change.words.removeprefix("quadruped, "): {w: errors_of(runs[f"{key}, {w}"], BODY) for w in FEEDFORWARDS}
        for key, change in walks.items()
    }
    change = change_cycle(runs["stiff, with CMAC"])
    columns = ["change", "", "error", "before", "worst since", "at the end", "cycles to before", "cycles to end"]
    parts: list[Part] = [
        Text(
            f"After {change} cycles the ground becomes {FACTOR} times as stiff, or {PAYLOAD} N are put on the body; "
            "planner and controller do not know. The rule is the lasting one (learning.lead=1; in the quadruped "
            "with gait.load_ramp=0.12 and force feedback of 1e-3)."
        ),
        Drawing(
            "recovery",
            figures.recovery(of_walks, {n: f"{m.words}, {m.unit}" for n, m in BODY.items()}, change),
            "The quadruped around a change (grey line): errors of each cycle, pooled over the legs. Feedback alone "
            "changes at once and stays; with CMAC errors are relearned.",
        ),
        Table(
            columns,
            _rows(runs),
            f"Levels are means of {CYCLES_OF_LEVEL} cycles; cycles until an error stays within {WITHIN} times its "
            "level before the change, and at the end",
            text_columns=3,
        ),
        Text(advice(runs)),
    ]
    return Section("Learning on after a change", parts, beyond=True)
