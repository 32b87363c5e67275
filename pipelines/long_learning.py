"""Learning over many cycles: bounded rules, leads and rates, and detection of drift.

``python -m pipelines.long_learning`` runs the paper's rule with several leads under the paper's conditions; and, in
worlds unknown to planner and controller, every rule on one leg and on the quadruped, delayed actuators, rates, and
parameters of the quadruped's force feedback.
"""

from functools import partial

import numpy as np

from cmacexp.cmac.rules import RULES
from cmacexp.study import (
    TRANSFER,
    Array,
    Declared,
    Results,
    declare,
    ended_in,
    find_history,
    per_seed,
    quotients,
    relative,
)
from pipelines.common_results import describe_end, if_completed, slide_median
from pipelines.worlds import FEWER, TESTED, draw_worlds

FORCE = "force_rmse_cycle"
RAMP = "gait.load_ramp=0.12"
FEEDBACK = ["force_control.elasticity=0.001", "force_control.admittance=0.001"]
"""Force feedback gains, ten times the paper's."""
LAST = 100
"""Number of last cycles over which final errors are computed."""
OTHERS = [rule for rule in RULES if rule != "paper"]


def find_variation(errors: Array) -> float:
    """Return the ratio of the largest to the least error (cycles,) in the second half of a run.

    Moving medians over 10 cycles are compared, since noise varies the errors of single cycles.
    """
    medians = slide_median(errors[len(errors) // 2 :], 10)
    return float(medians.max() / medians.min())


def one_too_short(results: Results) -> Array:
    """Return the share of cycles done with a lead of one less than ``auto`` for the same seed and delay, (runs,)."""
    auto = results.select({"learning.lead": "auto"})
    short = [
        row
        for row in results.rows
        if row.settings["learning.lead"] != "auto"
        and row.measures["lead"] + 1
        == auto.select({key: row.settings[key] for key in ("seed", "actuator.delay")}).measure("lead")[0]
    ]
    return Results(short).done


def error_when_detected(results: Results) -> list[float]:
    """Return the error when drift was detected relative to the least error up to then.

    One value for each run that ended early and in which drift was detected.
    """
    errors = [
        row.history(TRANSFER)[: int(row.measures["detected"])]
        for row in results.rows
        if not row.run.completed and np.isfinite(row.measures["detected"])
    ]
    return [float(history[-1] / history.min()) for history in errors]


def best_of_others(results: Results, lead: int | str, name: str) -> Array:
    """Return a final error of the best other rule relative to the paper's rule with lead `auto`, (worlds,).

    ``lead`` is that of the other rules. For each world, the best rule is the one with the least median in all other
    worlds, so that a rule is not chosen by the values on which it is judged.
    """
    paper = results.select({"learning.rule": "paper", "learning.lead": "auto"})
    final = partial(Results.end, name=name, cycles=LAST)
    rules = results.select({"learning.rule": OTHERS, "learning.lead": lead})
    ratios = np.array([relative(rule, paper, final) for rule in rules.by("learning.rule").values()])
    worlds = range(ratios.shape[1])
    elsewhere = [np.delete(ratios, world, axis=1) if len(worlds) > 1 else ratios for world in worlds]
    return np.array([ratios[np.median(elsewhere[world], axis=1).argmin(), world] for world in worlds])


def over_best_rate(results: Results) -> Array:
    """Return the final error with rate ``auto`` relative to the least with any other rate, (worlds,)."""
    fixed = results.select({"learning.rate": [rate for rate in results.values("learning.rate") if rate != "auto"]})
    auto = results.select({"learning.rate": "auto"}).end(TRANSFER, LAST)
    return quotients(auto, per_seed(fixed, fixed.end(TRANSFER, LAST), min))  # worlds are in the same order


def _describe_drift(results: Results) -> str:
    medians = {"detected": np.median(results.measure("detected")), "ended": np.median(ended_in(results))}
    return "; ".join(f"{what} in {cycle:.0f}" for what, cycle in medians.items() if np.isfinite(cycle)) or "-"


def _part(name: str, machine: str, cycles: int, over: Declared, *more: str, worlds: range = FEWER) -> Declared:
    """Return the runs of a machine in ``worlds``, with the overrides ``more``; ``over`` names values to combine."""
    scenario, *words = {"one leg": ("one_leg", "reference=aware"), "quadruped": ("quadruped",)}[machine]
    return {
        "set": [
            f"scenario={scenario}",
            *("learning=lasting", "learning.guard=none", "record.every_nth_step=600"),
            *words,
            f"cycles={cycles}",
            *more,
        ],
        "quick": {"cycles": 40 if machine == "one leg" else 12},
        "over": {"world": draw_worlds(scenario, worlds), **over},
        "labels": {"part": name, "machine": machine},
    }


def _published(machine: str, quick: int, *words: str) -> Declared:
    """Return runs of the paper's rule under the paper's conditions, with every lead and seed."""
    return {
        "set": [*words, "record.every_nth_step=600", "learning.rule=paper"],
        "quick": {"cycles": quick},
        "over": {"learning.lead": [-1, 0, 1, 2]},
        "seeds": True,
        "labels": {"part": "paper's world", "machine": machine},
    }


LEADS = {"learning.lead": [0, "auto"], "learning.rule": ["paper", *OTHERS]}
DONE = {"quantity": "cycles done of those asked for", "value": lambda runs: runs.done}
ENDS = {**DONE, "limit": "at most 90 %"}
MADE = {"part": "paper's world", "learning.rule": "paper"}
PAPER_RULE = {"part": "rules", "learning.rule": "paper"}
STEADY: Declared = {
    "quantity": "largest error over the least in the second half of the run", "limit": "at most 1.25",
    "value": lambda runs: runs.measure("variation"),
}  # fmt: skip
FORCE_STEADY = {
    **STEADY, "value": lambda runs: runs.measure("force_variation"),
    "quantity": "largest force error over the least in the second half of the run",
}  # fmt: skip


def _others(what: str, lead: int | str, name: str, machine: str, limit: float) -> Declared:
    return {
        "quantity": f"{what} of the rule that is best in other worlds, lead {lead}, over that of the paper's rule "
        "with lead auto",
        "value": partial(best_of_others, lead=lead, name=name),
        "of": {"part": "rules", "machine": machine},
        "limit": f"at most {limit}",
    }


IN_MM = partial(describe_end, quantity=lambda runs: 1e3 * runs.end(TRANSFER, LAST))
BY_LEAD: Declared = {"across": {"learning.lead": "lead"}, "value": IN_MM}
STUDY = declare(
    title="Learning over many cycles",
    question="With which rules, leads and rates does learning last, and how early can this be predicted?",
    runs=[
        _published("one leg", 40, "scenario=one_leg", "cycles=2000"),
        _published("quadruped", 12, "scenario=quadruped", "cycles=500", RAMP),
        _part("rules", "one leg", 500, LEADS),
        _part("rules", "quadruped", 500, LEADS, RAMP),
        _part("late", "one leg", 300, {"actuator.delay": [0, 1, 2], "learning.lead": [0, 1, 2, 3, 4, "auto"]}),
        _part("rates", "one leg", 500, {"learning.rate": ["auto", 0.05, 0.1, 0.1953125, 0.4, 0.8, 1.5]}),
        _part("settings", "quadruped", 500, worlds=TESTED, over={
            "settings": {"as published": [], "ramp": [RAMP], "force feedback": FEEDBACK,
                         "ramp, force feedback": [RAMP, *FEEDBACK]},
        }),
    ],
    measures={
        # The cycle in which drift was detected, infinite if it was not; the lead, also where the config says auto.
        "detected": lambda run: run.manifest["drift"]["named"] if run.manifest["drift"] else np.inf,
        "lead": lambda run: run.manifest["learning_lead"],
        "variation": if_completed(lambda run: find_variation(find_history(run.pooled, TRANSFER))),
        "force_variation": if_completed(lambda run: find_variation(run.pooled[FORCE])),
    },
    findings={
        "lead": {
            "says": "Under the paper's conditions, runs with lead 0, as published, end early, and with lead 1 the "
            "error of one leg stays bounded",
            "criteria": [
                {**ENDS, "of": {**MADE, "learning.lead": 0}, "each": {"machine": ["one leg", "quadruped"]},
                 "case": "{machine}, lead 0"},
                {**STEADY, "of": {**MADE, "machine": "one leg", "learning.lead": 1}, "case": "one leg, lead 1"},
            ],
        },
        "lasts": {
            "says": "In randomised runs, the error of one leg stays bounded with the paper's rule, lead and rate "
            "`auto`; with lead 0 runs end early",
            "criteria": [
                {**STEADY, "of": {**PAPER_RULE, "machine": "one leg", "learning.lead": "auto"},
                 "case": "one leg, lead auto"},
                {**ENDS, "of": {**PAPER_RULE, "learning.lead": 0}, "each": {"machine": ["one leg", "quadruped"]},
                 "case": "{machine}, lead 0"},
            ],
        },
        "body": {
            "says": "In randomised runs, lead `auto` is enough under a body too",
            **FORCE_STEADY, "of": {**PAPER_RULE, "machine": "quadruped", "learning.lead": "auto"},
            "case": "quadruped, lead auto",
        },
        "rules_one leg": {
            "says": "In randomised runs, with lead `auto`, another rule lowers the transfer error of one leg by a "
            "tenth",
            **_others("transfer error", "auto", TRANSFER, "one leg", 0.9),
        },
        "rules_quadruped": {
            "says": "In randomised runs, with lead `auto`, another rule lowers the force error of the quadruped by a "
            "tenth",
            **_others("force error", "auto", FORCE, "quadruped", 0.9),
        },
        "substitute": {
            "says": "In randomised runs, a rule can replace the right lead on one leg",
            **_others("error", 0, TRANSFER, "one leg", 1.1),
        },
        "late": {
            "says": "In randomised runs, the lead must be at least the number of samples from torque to feedback, "
            "which `learning.lead=auto` counts",
            "criteria": [
                {"quantity": "runs that complete", "value": lambda runs: runs.completed,
                 "of": {"part": "late", "learning.lead": "auto"},
                 "case": "lead auto", "limit": "at least 80 %"},
                {**ENDS, "value": one_too_short, "of": {"part": "late"}, "case": "lead one less"},
            ],
        },
        "latest": {
            "says": "In randomised runs, one leg needs no guard with lead and rate `auto` and torques delayed by up "
            "to 2 samples",
            "criteria": [
                {"quantity": "runs that complete", "value": lambda runs: runs.completed,
                 "case": f"lead auto, torque {delay} samples late",
                 "of": {"part": "late", "learning.lead": "auto", "actuator.delay": delay}, "limit": "at least 75 %"}
                for delay in (0, 1, 2)
            ],
        },
        "rate": {
            "says": "In randomised runs, the error of one leg with rate `auto` is at most 1.25 times that with the "
            "best of the rates tried",
            "quantity": "error at the end with rate auto over the least with another rate, lead auto",
            "value": over_best_rate, "of": {"part": "rates"}, "limit": "at most 1.25",
        },
        "fast": {
            "says": "In randomised runs, one leg with lead `auto` completes its cycles at rates of 0.4 and 0.8",
            "criteria": [
                {**DONE, "of": {"part": "rates", "learning.rate": rate}, "case": f"lead auto, rate {rate}",
                 "limit": "at least 90 %"}
                for rate in (0.4, 0.8)
            ],
        },
        "settings": {
            "says": "In randomised runs, stronger force feedback, as in `scenario=quadruped_lasting`, at least "
            "halves the quadruped's force error and keeps it steady",
            "criteria": [
                {"quantity": "force error at the end with ramp and stronger force feedback, over that with the ramp "
                             "alone",
                 "value": lambda runs: runs.end(FORCE, LAST),
                 "of": {"part": "settings", "settings": "ramp, force feedback"},
                 "over": {"settings": "ramp"}, "limit": "at most 0.5"},
                {**FORCE_STEADY, "of": {"part": "settings", "settings": "ramp, force feedback"},
                 "case": "ramp and stronger force feedback"},
            ],
        },
        "drift": {
            "says": "Drift is detected in time to stop learning in most runs that diverge or fall",
            "criteria": [
                {"quantity": "runs that end before their time in which drift is detected", 
                 "value": lambda results: results.measure("detected")[~np.array(results.completed)] < np.inf,
                 "of": {"part": ["rules", "late", "rates"]}, "limit": "at least 80 %"},
                {"quantity": "error in the cycle of detection over the least up to it", "value": error_when_detected,
                 "of": {"part": ["rules", "late", "rates"]}, "limit": "at most 1.25"},
            ],
        },
    },
    figures={
        "leads": [
            {"metric": name, "by": "learning.lead", "of": {**MADE, "machine": machine}, "log": "xy",
             "title": f"{machine}, by lead: {title}"}
            for machine in ("one leg", "quadruped")
            for name, title in (("transfer_rmse_y", "transfer error in y"),
            ("feedback_change", "change of the feedback"))
        ],
        "rules": [
            {"metric": f"transfer_rmse_{side}", "by": "learning.rule", "log": "xy",
             "title": f"transfer error in {side}",
             "of": {"part": "rules", "machine": "one leg", "learning.lead": "auto"}}
            for side in "xy"
        ],
        "settings": [
            {"metric": name, "by": "settings", "of": {"part": "settings"}, "log": "xy", "title": title}
            for name, title in ((FORCE, "force error"), ("tilt_max", "largest tilt"))
        ],
    },
    tables={
        "leg": {"rows": {"learning.rule": "rule"}, "of": {"part": "rules", "machine": "one leg"}, **BY_LEAD},
        "walk": {
            "rows": {"learning.rule": "rule"}, "of": {"part": "rules", "machine": "quadruped"}, **BY_LEAD,
            "value": partial(describe_end, quantity=lambda runs: runs.end(FORCE, LAST)),
        },
        "published": {"rows": "machine", "of": MADE, **BY_LEAD},
        "drift": {"rows": "machine", "of": MADE, **BY_LEAD, "value": _describe_drift},
        "late": {"rows": {"actuator.delay": "delay, samples"}, "of": {"part": "late"}, **BY_LEAD},
        "rates": {"rows": {"learning.rate": "rate"}, "columns": {"error": IN_MM}, "of": {"part": "rates"}},
    },
)  # fmt: skip
