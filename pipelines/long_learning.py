"""Learning over many cycles: which rules, leads and rates last, and whether drift and growth predict it.

``python -m pipelines.long_learning`` runs the paper's rule with several leads in the paper's own world; and, in
worlds that nobody in the loop knows, every rule on one leg and on the quadruped, late actuators, rates, and settings
of the quadruped's force feedback.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cmacexp.cmac.rules import RULES
from cmacexp.metrics.final import TRANSFER
from cmacexp.study import (
    Criterion,
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
from cmacexp.study.curves import over_cycles
from cmacexp.study.samples import ended_in, per_seed, quotients, relative
from cmacexp.study.tables import cross_tabulate, tabulate
from cmacexp.typing import Array
from pipelines import long_learning_measures as measures
from pipelines.common_results import describe_end, percent, tabulate_ends
from pipelines.long_learning_measures import FORCE, GRID, LAST, LEG, PAPER, WALK, final
from pipelines.worlds import FEWER, TESTED, in_worlds

WORLD, LATE, RATE, SETTING = "rules", "late", "rates", "settings"
"""Parts of the study in worlds, besides GRID in the paper's: column ``part``."""
RATES = ("auto", 0.05, 0.1, 0.1953125, 0.4, 0.8, 1.5)
AUTO, FAST = RATES[0], RATES[-3:-1]
DELAYS = (0, 1, 2)
"""Of the actuator, besides what sensors delay, samples."""
THIN = "record.every_nth_step=600"
"""Metrics are of every step; of the traces little is kept."""
RAMP = "gait.load_ramp=0.12"
FEEDBACK = ("force_control.elasticity=0.001", "force_control.admittance=0.001")
"""Force feedback ten times the paper's."""
PUBLISHED, RAMPED, FELT = "as published", "ramp", "ramp, force feedback"
SETTINGS = {PUBLISHED: [], RAMPED: [RAMP], "force feedback": FEEDBACK, FELT: [RAMP, *FEEDBACK]}
MACHINES: dict[str, tuple[str, tuple[str, ...]]] = {
    LEG: ("one_leg", ("reference=aware",)),
    WALK: ("quadruped", ()),
}
"""Scenario and further overrides in worlds."""
NEAR = 0.01
"""Difference of two growths up to which one predicts the other."""


def runs(quick: bool) -> list[Request]:
    """All parts; those in the paper's world for every seed, or other rules once, the rest in every world."""
    others = [rule for rule in RULES if rule != "paper"][: 1 if quick else None]
    leads, worlds = (0, 1) if quick else (-1, 0, 1, 2), FEWER[:1] if quick else FEWER
    lasting = ("learning=lasting", "learning.guard=none", THIN)
    rules = {"learning.rule": ("paper", *others)}

    def cycles(machine: str, number: int) -> str:
        return f"cycles={(40 if machine == LEG else 12) if quick else number}"

    def published(machine: str, scenario: str, number: int, *more: str, rules: Sequence[str], seeded: bool) -> Any:
        common = (f"scenario={scenario}", cycles(machine, number), THIN, *more)
        over = {"learning.rule": rules, "learning.lead": leads}
        return grid(*common, over=over, seeded=seeded, part=GRID, machine=machine)

    def part(
        name: str, machine: str, number: int, over: Mapping[str, Any], *more: str, worlds: Sequence[int] = worlds
    ) -> list[Request]:
        scenario, overrides = MACHINES[machine]
        words = (*lasting, *overrides, cycles(machine, number), *more)
        return in_worlds(scenario, worlds, *words, over=over, part=name, machine=machine)

    late = {"actuator.delay": DELAYS[:2] if quick else DELAYS, "learning.lead": (0, 1, 2, 3, 4, "auto")}
    return [
        *published(LEG, "one_leg", 2_000, rules=["paper"], seeded=True),
        *published(WALK, "quadruped", 500, RAMP, rules=["paper"], seeded=True),
        *published(LEG, "one_leg", 1_000, rules=others, seeded=False),
        *part(WORLD, LEG, 500, {"learning.lead": (0, "auto"), **rules}),
        *part(WORLD, WALK, 500, {"learning.lead": (0, "auto"), **rules}, RAMP),
        *part(LATE, LEG, 300, late),
        *part(RATE, LEG, 500, {"learning.rate": (AUTO, *FAST) if quick else RATES}),
        *part(SETTING, WALK, 500, {"settings": SETTINGS}, worlds=worlds if quick else TESTED),
    ]


def best_of_others(results: Results, lead: int | str, name: str) -> Array:
    """(worlds,): error at the end of another rule with a lead, over the paper's rule with lead `auto`.

    In each world the rule is the one whose median is least in all other worlds: not chosen by what it is judged by.
    """
    own = results.select({**PAPER, "learning.lead": "auto"})
    rules = results.select({"learning.rule": [rule for rule in RULES if rule != "paper"], "learning.lead": lead})
    ratios = np.array([relative(rule, own, partial(final, name=name)) for rule in rules.by("learning.rule").values()])
    worlds = range(ratios.shape[1])
    elsewhere = [np.delete(ratios, world, axis=1) if len(worlds) > 1 else ratios for world in worlds]
    return np.array([ratios[np.median(elsewhere[world], axis=1).argmin(), world] for world in worlds])


def over_best_rate(results: Results) -> Array:
    """(worlds,): error at the end with rate ``auto`` over the least with another rate."""
    auto = results.select({"learning.rate": AUTO})
    others = results.select({"learning.rate": list(RATES[1:])})
    errors = final(others)
    least = dict(zip(others.values("seed"), per_seed(others, errors, min), strict=True))
    return quotients(final(auto), np.array([least[row.settings["seed"]] for row in auto.rows]))


def _with_feedback(results: Results) -> Array:
    """(worlds,): force error at the end with stronger force feedback over that without."""
    felt, ramped = (results.select(settings=name) for name in (FELT, RAMPED))
    return relative(felt, ramped, partial(final, name=FORCE))


DONE = "cycles done of those asked for"
WARNED = {"part": [WORLD, LATE, RATE]}


def _paper(machine: str, lead: int | str, part: str) -> dict[str, Any]:
    return {"part": part, "machine": machine, "learning.lead": lead, **PAPER}


def _ends(case: str, of: Mapping[str, Any], sample: Any = "done") -> Criterion:
    return percent(DONE, sample, at_most(0.9), None, of, case)


def _complete(case: str, of: Mapping[str, Any], least: float) -> Criterion:
    return percent("runs that complete", "completed", at_least(least), None, of, case)


def _steady(case: str, of: Mapping[str, Any], name: str = TRANSFER) -> Criterion:
    quantity = f"largest {'force ' * (name == FORCE)}error over the least in the second half of the run"
    return Criterion(quantity, partial(measures.variation, name=name), at_most(1.25), of=of, case=case)


def _others(what: str, lead: int | str, name: str, machine: str, limit: float) -> Criterion:
    return Criterion(
        f"{what} of the rule that is best in other worlds, lead {lead}, over that of the paper's rule with lead auto",
        partial(best_of_others, lead=lead, name=name),
        at_most(limit),
        of={"part": WORLD, "machine": machine},
    )


KNOWN, UNKNOWN = "Under the paper's conditions,", "In randomised runs,"
FINDINGS = {
    "lead": Finding(
        [
            *(_ends(f"{machine}, lead 0", _paper(machine, 0, GRID)) for machine in (LEG, WALK)),
            _steady("one leg, lead 1", _paper(LEG, 1, GRID)),
        ],
        says=f"{KNOWN} runs with lead 0, as published, end early, and with lead 1 the error of one leg stays bounded",
    ),
    "lasts": Finding(
        [
            _steady("one leg, lead auto", _paper(LEG, "auto", WORLD)),
            *(_ends(f"{machine}, lead 0", _paper(machine, 0, WORLD)) for machine in (LEG, WALK)),
        ],
        says=f"{UNKNOWN} the error of one leg stays bounded with the paper's rule, lead and rate "
        "`auto`; with lead 0 runs end early",
    ),
    "body": Finding(
        [_steady("quadruped, lead auto", _paper(WALK, "auto", WORLD), FORCE)],
        says=f"{UNKNOWN} lead `auto` is enough under a body too",
    ),
    **{
        f"rules_{machine}": Finding(
            [_others(f"{what} error", "auto", name, machine, 0.9)],
            says=f"{UNKNOWN} with lead `auto`, another rule lowers the {what} error of {who} by a tenth",
        )
        for machine, who, what, name in (
            (LEG, "one leg", "transfer", TRANSFER),
            (WALK, "the quadruped", "force", FORCE),
        )
    },
    "substitute": Finding(
        [_others("error", 0, TRANSFER, LEG, 1.1)],
        says=f"{UNKNOWN} a rule can replace the right lead on one leg",
    ),
    "late": Finding(
        [
            _complete("lead auto", {"part": LATE, "learning.lead": "auto"}, 0.8),
            _ends("lead one less", {"part": LATE}, measures.one_too_short),
        ],
        says=f"{UNKNOWN} the lead must be at least the number of samples from torque to feedback, "
        "which `learning.lead=auto` counts",
    ),
    "latest": Finding(
        [
            _complete(
                f"lead auto, torque {delay} samples late",
                {"part": LATE, "learning.lead": "auto", "actuator.delay": delay},
                0.75,
            )
            for delay in DELAYS
        ],
        says=f"{UNKNOWN} one leg needs no guard with lead and rate `auto` and torques delayed by up to "
        f"{DELAYS[-1]} samples",
    ),
    "rate": Finding(
        [
            Criterion(
                "error at the end with rate auto over the least with another rate, lead auto",
                over_best_rate,
                at_most(1.25),
                of={"part": RATE},
            )
        ],
        says=f"{UNKNOWN} the error of one leg with rate `auto` is at most 1.25 times that with the "
        "best of the rates tried",
    ),
    "fast": Finding(
        [
            percent(
                DONE,
                "done",
                at_least(0.9),
                of={"part": RATE, "learning.rate": rate},
                case=f"lead auto, rate {rate}",
            )
            for rate in FAST
        ],
        says=f"{UNKNOWN} one leg with lead `auto` completes its cycles at rates of {FAST[0]} and {FAST[1]}",
    ),
    "settings": Finding(
        [
            Criterion(
                "force error at the end with ramp and stronger force feedback, over that with the ramp alone",
                _with_feedback,
                at_most(0.5),
                of={"part": SETTING},
            ),
            _steady("ramp and stronger force feedback", {"part": SETTING, "settings": FELT}, FORCE),
        ],
        says=f"{UNKNOWN} stronger force feedback, as in `scenario=quadruped_lasting`, at least halves "
        "the quadruped's force error and keeps it steady",
    ),
    "drift": Finding(
        [
            percent(
                "runs that end before their time in which drift is detected",
                measures.detected_if_ended,
                at_least(0.8),
                of=WARNED,
            ),
            Criterion(
                "error in the cycle of detection over the least up to it",
                measures.error_when_detected,
                at_most(1.25),
                of=WARNED,
            ),
        ],
        says="Drift is detected in time to stop learning in most runs that diverge or fall",
    ),
    **{
        f"growth_{machine}": Finding(
            [
                Criterion(
                    "largest difference between predicted and measured growth per cycle, paper's rule",
                    partial(measures.growth_miss, machine=machine),
                    at_most(NEAR),
                    case=machine,
                )
            ],
            says=f"{KNOWN} the linearised loop predicts the growth per cycle of the paper's rule "
            f"({machine}) with every lead",
        )
        for machine in (LEG, WALK)
    },
}


RULE_ERRORS = {"transfer_rmse_x": "transfer error in x", "transfer_rmse_y": "transfer error in y"}
LEADS_BY, RULES_BY = ("learning.lead", "lead"), ("learning.rule", "rule")
IN_MM = f"1e3 * {TRANSFER}[-{LAST}:]"
ENDS = partial(describe_end, quantity=f"1e3 * {TRANSFER}[-{LAST}:]")
WALK_ERRORS = {FORCE: "force error", "tilt_max": "largest tilt"}


def _curves(results: Results, names: Mapping[str, str], by: str, before: str = "") -> list[Panel]:
    """Metrics over cycles, by their titles."""
    panels = {title: over_cycles(results, name, by, log="xy", title=title) for name, title in names.items()}
    return [replace(panel, title=before + title) for title, panel in panels.items()]


def draw_leads(results: Results) -> Figure:
    """The paper's rule with every lead, on both machines."""
    names = {"transfer_rmse_y": "transfer error in y", "feedback_change": "change of the feedback"}
    machines = results.by("machine").items()
    panels = [_curves(own, names, "learning.lead", f"{machine}, by lead: ") for machine, own in machines]
    return draw([panel for own in panels for panel in own])


def draw_growth(results: Results) -> Figure:
    """Predicted against measured growth, and the difference."""
    known = {machine: measures.growth_known(results, machine) for machine in (LEG, WALK)}
    axis, panels = "measured growth per cycle", []
    for column, title, limits in (
        ("predicted", "predicted growth per cycle", ()),
        ("misses", "predicted - measured", (-NEAR, NEAR)),
    ):
        series = [Series(name, own["measured"], own[column]) for name, own in known.items()]
        panels.append(Panel(title, axis, title, series, "scatter", y_limits=limits))
    return draw(panels)


def _drift(results: Results) -> str:
    medians = {"detected": np.median(results.measure("detected")), "ended": np.median(ended_in(results))}
    return "; ".join(f"{what} in {cycle:.0f}" for what, cycle in medians.items() if np.isfinite(cycle)) or "-"


def values(results: Results) -> dict[str, Any]:
    """Cycles of each part, and settings that the page names."""
    published, felt = (results.select(settings=name) for name in (PUBLISHED, FELT))
    gain = "force_control.elasticity"
    grid_cycles = {machine: results.select(PAPER, part=GRID, machine=machine).value("cycles") for machine in MACHINES}
    return {
        "cycles": {part: results.select(part=part).values("cycles")[0] for part in (WORLD, LATE, RATE, SETTING)},
        "walk_cycles": results.select(part=WORLD, machine=WALK).value("cycles"),
        "grid_cycles": {name: f"{number:,}" for name, number in grid_cycles.items()},
        "ramp": felt.value("gait.load_ramp"), "gain": felt.value(gain), "published_gain": published.value(gain),
        "worlds": len(FEWER), "setting_worlds": len(TESTED), "last": measures.LAST, "near": NEAR,
        "smoothed": measures.SMOOTHED,
    }  # fmt: skip


STUDY = Study(
    title="Learning over many cycles",
    question="With which rules, leads and rates does learning last, and how early can this be predicted?",
    runs=runs,
    measures={"detected": measures.detected, "lead": measures.learning_lead},
    computed={"growth": measures.growth},
    findings=FINDINGS,
    figures={
        "leads": lambda r: draw_leads(r.select(PAPER, part=GRID)),
        "rules": lambda r: draw(
            _curves(r.select({"learning.lead": "auto"}, part=WORLD, machine=LEG), RULE_ERRORS, "learning.rule")
        ),
        "growth": draw_growth,
        "settings": lambda r: draw(_curves(r.select(part=SETTING), WALK_ERRORS, "settings")),
    },
    tables={
        "leg": tabulate_ends(IN_MM, RULES_BY, LEADS_BY, {"part": WORLD, "machine": LEG}),
        "walk": tabulate_ends(f"{FORCE}[-{LAST}:]", RULES_BY, LEADS_BY, {"part": WORLD, "machine": WALK}),
        "published": tabulate_ends(IN_MM, ("machine", "machine"), LEADS_BY, {**PAPER, "part": GRID}),
        "drift": lambda r: cross_tabulate(r.select(PAPER, part=GRID), ("machine", "machine"), LEADS_BY, _drift),
        "late": tabulate_ends(IN_MM, ("actuator.delay", "delay, samples"), LEADS_BY, {"part": LATE}),
        "rates": lambda r: tabulate(
            r.select(part=RATE), {"learning.rate": "rate"}, {"error": partial(describe_end, quantity=IN_MM)}
        ),
    },
    values=values,
)
