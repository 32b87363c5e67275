"""How much each value that Lin & Song 1997 do not give changes the conclusions.

``python -m pipelines.assumptions`` changes one assumed value at a time, of one leg, of the quadruped and of the point
mass, and evaluates every conclusion again.
"""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Drawing, Section, Table, Text
from pipelines.analysis.assumptions_conclusions import (
    Conclusion,
    Outcome,
    changed_by,
    cycle_of,
    matters,
    methods,
    one_leg,
    quadruped,
    shown,
)
from pipelines.analysis.assumptions_figure import draw
from pipelines.analysis.assumptions_list import METHODS, ONE_LEG, QUADRUPED, Assumption
from pipelines.analysis.measured import listed
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

LEG, WALK, MASS = "one leg", "quadruped", "point mass"
MACHINES = {
    LEG: (ONE_LEG, ("scenario=one_leg", "cycles=20")),
    WALK: (QUADRUPED, ("scenario=quadruped", "cycles=20")),
    MASS: (METHODS, ("scenario=force_step",)),
}
QUICK = {LEG: ("cycles=5",), WALK: ("cycles=5",), MASS: ()}
CONTROL = ("stiffness", "damping", "combined")
CHANGED = " ≠"
"""Marks a number whose conclusion changes."""


def _name(machine: str, assumption: Assumption | None = None, value: str = "") -> str:
    return f"{machine}, {assumption.name} {value}" if assumption else machine


def jobs(quick: bool) -> Jobs:
    """Every value of every assumption, by name; of the point mass, with each method."""
    wanted: dict[str, list[str]] = {}
    for machine, (assumptions, common) in MACHINES.items():
        variants = {_name(machine): [*common, *(QUICK[machine] if quick else ())]}
        base = variants[_name(machine)]
        for a in assumptions:
            for value in a.values[:1] if quick else a.values:
                if a.quick or not quick:
                    variants[_name(machine, a, value)] = [*base, *a.overrides(value)]
        for name, overrides in variants.items():
            each = {f"{name} {m}": [*overrides, f"force_control={m}"] for m in CONTROL}
            wanted |= each if machine == MASS else {name: overrides}
    return wanted


def _later(run: StoredRun) -> str:
    """From which cycle on both transfer errors are small."""
    cycle = cycle_of(run, ("transfer_rmse_x", "transfer_rmse_y"))
    return f"{cycle:.0f}" if isfinite(cycle) else "-"


def outcomes_of(
    machine: str, conclusions: Sequence[Conclusion], runs: Mapping[str, Any], config: Mapping[str, Any]
) -> tuple[Outcome, list[Outcome]]:
    """What the values taken led to, and each other value that was run.

    Args:
        machine: one of :data:`MACHINES`.
        conclusions: to be drawn again.
        runs: by name; of the point mass, those of the methods by name of the variant.
        config: that of the values taken.
    """

    def outcome(name: str, assumption: str, taken: str, value: str) -> Outcome:
        run = runs[name]
        later = _later(run) if isinstance(run, StoredRun) else ""
        return Outcome(assumption, taken, value, tuple(c.measure(run) for c in conclusions), later)

    others = [
        outcome(_name(machine, a, value), a.name, a.taken(config), a.label(value))
        for a in MACHINES[machine][0]
        for value in a.values
        if _name(machine, a, value) in runs
    ]
    return outcome(_name(machine), "values taken", "", ""), others


def table(taken: Outcome, outcomes: Sequence[Outcome], conclusions: Sequence[Conclusion]) -> Table:
    """Every number, marked where it changes a conclusion."""
    rows = []
    for outcome in (taken, *outcomes):
        changes = changed_by(outcome, taken.numbers, conclusions)
        numbers = [shown(n) + (CHANGED if k in changes else "") for k, n in enumerate(outcome.numbers)]
        name = f"{outcome.assumption} {outcome.taken} → {outcome.value}" if outcome.value else outcome.assumption
        rows.append([name, *numbers, *([outcome.later] if taken.later else [])])
    columns = ["value taken → tried", *(c.what for c in conclusions), *(["small from"] if taken.later else [])]
    return Table(columns, rows, f"{CHANGED.strip()}: the conclusion differs from that with the values taken")


def legend(taken: Outcome, conclusions: Sequence[Conclusion]) -> str:
    """What the columns of the table mean, and which conclusions hold with the values taken."""
    measured = "; ".join(f"{c.what}: {c.axis}" for c in conclusions)
    later = (
        "; small from: cycle from which on x and y errors stay at most a quarter of those of cycle 1"
        if taken.later
        else ""
    )
    holding = [c.name for c, n in zip(conclusions, taken.numbers, strict=True) if c.holds(n)]
    return f"In the table, {measured}{later}. With the values taken hold: {listed(holding)}."


def _consequence(outcome: Outcome, taken: Outcome, conclusions: Sequence[Conclusion]) -> str:
    instead = f"{outcome.value} instead of {outcome.taken}"
    if outcome.falls:
        return f"{instead}, it falls"
    changes = changed_by(outcome, taken.numbers, conclusions)
    changed = [f"{conclusions[k].what} {shown(outcome.numbers[k])}, not {shown(taken.numbers[k])}" for k in changes]
    later = f" (both at most a quarter from cycle {outcome.later} on)" if outcome.later not in ("", "-") else ""
    return f"{instead}, {listed(changed)}{later}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


def _range(place: int, taken: Outcome, outcomes: Sequence[Outcome], conclusion: Conclusion) -> str:
    numbers = [n for n in (o.numbers[place] for o in (taken, *outcomes)) if isfinite(n)]
    limits = " to ".join(shown(n) for n in (conclusion.least, conclusion.most) if isfinite(n))
    return f"{conclusion.what} ({conclusion.axis}) {shown(min(numbers))} to {shown(max(numbers))}, limit {limits}"


def verdict(taken: Outcome, outcomes: Sequence[Outcome], conclusions: Sequence[Conclusion]) -> list[str]:
    """Which assumptions matter, how, and which do not: one paragraph for each that does."""
    changing, harmless = matters(outcomes, taken.numbers, conclusions)
    going = [o for o in outcomes if not o.falls]
    changes = {k for o in going for k in changed_by(o, taken.numbers, conclusions)}
    missed = ["" if c.holds(n) else " (does not hold)" for c, n in zip(conclusions, taken.numbers, strict=True)]
    safe = [c.name + missed[k] for k, c in enumerate(conclusions) if k not in changes]
    ranges = [_range(k, taken, outcomes, c) for k, c in enumerate(conclusions)]
    but = "" if len(going) == len(outcomes) else " with which it does not fall"
    return [
        f"Of {_count(len(changing) + len(harmless), 'assumption')}, tried with {_count(len(outcomes), 'other value')}"
        f", {len(changing)} can change a conclusion. No value tried of these changes any: {listed(harmless)}.",
        f"Conclusions that are the same with every value{but}: {listed(safe)}. Over all values: {'; '.join(ranges)}.",
        *(
            f"{name[0].upper()}{name[1:]}: with "
            + "; with ".join(_consequence(outcome, taken, conclusions) for outcome in values)
            + "."
            for name, values in changing.items()
        ),
    ]


def _caption(taken: Outcome, outcomes: Sequence[Outcome], conclusions: Sequence[Conclusion]) -> str:
    changing, harmless = matters(outcomes, taken.numbers, conclusions)
    summary = f"{len(harmless)} of {_count(len(changing) + len(harmless), 'assumption')} change no conclusion."
    if not changing:
        return summary
    most = max(outcomes, key=lambda o: len(changed_by(o, taken.numbers, conclusions)))
    count = len(changed_by(most, taken.numbers, conclusions))
    return (
        f"{summary} The largest change is due to {most.assumption} {most.value} instead of {most.taken}: "
        f"{count} of {_count(len(conclusions), 'conclusion')}."
    )


def _section(machine: str, conclusions: Sequence[Conclusion], runs: Mapping[str, Any], config: Any) -> Section:
    taken, outcomes = outcomes_of(machine, conclusions, runs, config)
    parts: list[Text | Table | Drawing] = [Text(text) for text in verdict(taken, outcomes, conclusions)]
    if machine != MASS:
        name, figure = f"assumptions_{machine.replace(' ', '_')}", draw(outcomes, taken, conclusions)
        parts.append(Drawing(name, figure, _caption(taken, outcomes, conclusions)))
    parts += [Text(legend(taken, conclusions)), table(taken, outcomes, conclusions)]
    return Section(f"What was assumed: {machine}", parts)


def by_method(runs: Mapping[str, StoredRun]) -> dict[str, dict[str, StoredRun]]:
    """Runs of the point mass by variant and method."""
    variants: dict[str, dict[str, StoredRun]] = {}
    for name, run in runs.items():
        if name.startswith(MASS):
            variant, method = name.rsplit(" ", 1)
            variants.setdefault(variant, {})[method] = run
    return variants


def summarise(runs: Runs) -> list[Section]:
    """One leg, quadruped, and the force control methods."""
    masses = by_method(runs)
    config = masses[MASS]["combined"].config
    return [
        _section(LEG, one_leg(), runs, runs[LEG].config),
        _section(WALK, quadruped(), runs, runs[WALK].config),
        _section(MASS, methods(), masses, config),
    ]


PURPOSE = "Each value that the paper does not give is changed alone; which of the paper's conclusions change?"
STUDY = Study("assumptions", "What the assumed values change", PURPOSE, jobs, summarise)

if __name__ == "__main__":
    main(STUDY)
