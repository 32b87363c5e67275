"""Learning with delayed feedback: lead, rate, rule, size of the CMAC, path, guard.

``python -m pipelines.late_learning`` tests the hyperparameters that `docs/long-runs.md` recommends with encoders,
delayed torques and lags, over more cycles than the studies that recommend them.
"""

from functools import partial

from cmacexp.cmac.rules import PAPER_RATE, RULES
from cmacexp.study import (
    FINAL_CYCLES,
    TRANSFER,
    Array,
    Declared,
    Results,
    Run,
    compute_growth,
    declare,
    find_history,
    per_seed,
    relative,
)
from pipelines.common_results import describe_end, if_completed, slide_median

WORLDS = {
    "on time": [],
    "encoders": ["sensors=encoders"],
    "torque two samples late": ["actuator.delay=2"],
    "lag of 5 ms": ["actuator.lag=0.005"],
    "lag of 15 ms": ["actuator.lag=0.015"],
}
LEG = {"one leg": ["scenario=one_leg", "learning=lasting"]}
MACHINES = {**LEG, "quadruped": ["scenario=quadruped_lasting"]}
OTHER_RULES = {f"rule {rule}": [f"learning.rule={rule}"] for rule in RULES if rule != "paper"}
SETTINGS = {
    "angles alone": ["cmac.inputs=[angle]"],
    "9 resolution elements": ["cmac.resolution_elements=9"],
    "8 layers": ["cmac.layers=8"],
    "128 layers": ["cmac.layers=128"],
    "path without jumps": ["gait.vertical=two_cubics"],
}
LEADS = {f"zero_phase, lead {lead}": ["learning.rule=zero_phase", f"learning.lead={lead}"] for lead in (3, 1)}
"""The longest lead that is right in one of these worlds, and the shortest."""


@if_completed
def least(run: Run) -> float:
    """Return the least moving median of the transfer error over FINAL_CYCLES cycles, m."""
    return float(slide_median(find_history(run.pooled, TRANSFER), FINAL_CYCLES).min())


def find_least_rule(results: Results) -> Array:
    """Return the least final error of all other rules relative to that of the paper's rule, (seeds,)."""
    other_rules = results.select(choice=list(OTHER_RULES))
    ratios = relative(other_rules, results.select(choice="default"), partial(Results.end, name=TRANSFER))
    return per_seed(other_rules, ratios, min)


def _part(name: str, machines: Declared, common: list[str], **over: object) -> Declared:
    """Return the runs of ``machines`` in every world; ``over`` names further values to combine."""
    return {
        "set": ["cycles=300", "record.cycles=[1]", *common],
        "quick": {"cycles": 4},
        "over": {"machine": machines, "world": WORLDS, **over},
        "seeds": True,
        "labels": {"part": name},
    }


UNGUARDED = "learning.guard=none"
LEAD_ONE = ["learning.lead=1", f"learning.rate={PAPER_RATE}"]
EVERYWHERE = {"world": list(WORLDS)}
DONE = "cycles done of those asked for, "
AUTO = {"part": "rate", "learning.rate": "auto"}
IN_MM: Declared = {
    "across": "world", "value": partial(describe_end, quantity=lambda runs: 1e3 * runs.end(TRANSFER)),
}  # fmt: skip
STAYS: Declared = {
    "quantity": "final error over the least", "limit": "at most 1.5", "each": EVERYWHERE,
    "value": lambda runs: compute_growth(runs.end(TRANSFER), runs.measure("least")),
}  # fmt: skip
STUDY = declare(
    title="Learning with delayed feedback",
    question="Do the lead, rate, rule, size and path that suit feedback without delay also suit delayed feedback?",
    runs=[
        _part("rate", MACHINES, [UNGUARDED], **{"learning.rate": ["auto", 0.05, PAPER_RATE, 0.4, 0.8]}),
        _part("lead 1", MACHINES, [UNGUARDED, *LEAD_ONE]),
        _part("lead 1, guarded", MACHINES, LEAD_ONE),
        _part("auto, guarded", MACHINES, []),
        _part("choice", LEG, [UNGUARDED], choice={"default": [], **SETTINGS, **OTHER_RULES, **LEADS}),
    ],
    measures={"least": least},
    findings={
        **{
            f"{name}_{machine}": {
                "says": f"{machine.capitalize()}: the error stays bounded with lead and rate `auto`, {guarded}, in "
                "every world",
                **STAYS, "of": {"machine": machine, **of},
            }
            for machine in MACHINES
            for name, guarded, of in (("auto", "unguarded", AUTO), ("guarded", "guarded", {"part": "auto, guarded"}))
        },
        **{
            f"{name}_{machine}": {
                "says": f"{machine.capitalize()}: runs complete with {what} in every world",
                "quantity": DONE + what, "value": lambda runs: runs.done, "limit": "at least 90 %",
                "of": {"machine": machine, **of}, "each": EVERYWHERE,
            }
            for machine in MACHINES
            for name, what, of in (
                ("fastest", "rate 0.8", {"part": "rate", "learning.rate": 0.8}),
                ("fast", "rate 0.4", {"part": "rate", "learning.rate": 0.4}),
                ("lead", "lead 1 at the paper's rate", {"part": "lead 1"}),
            )
        },
        "paper_rate": {
            "says": "With the right lead the error of one leg with the paper's rate is at most 1.25 times that with "
            "`auto` in every world",
            "quantity": "final error with the paper's rate over that with rate auto", "over": AUTO,
            "value": lambda runs: runs.end(TRANSFER),
            "of": {"part": "rate", "machine": "one leg", "learning.rate": PAPER_RATE}, "each": EVERYWHERE,
            "limit": "at most 1.25",
        },
        **{
            f"wrong_{machine}": {
                "says": f"{machine.capitalize()}: guarded learning with lead 1 ends no worse than feedback only in "
                "every world",
                "quantity": "final error over feedback only",
                "value": lambda runs: compute_growth(runs.end(TRANSFER), runs.at(1, TRANSFER)),
                "of": {"part": "lead 1, guarded", "machine": machine}, "each": EVERYWHERE, "limit": "at most 1.05",
            }
            for machine in MACHINES
        },
        "rules": {
            "says": "One leg completes with every rule in every world",
            "quantity": f"{DONE}every rule", "value": lambda runs: runs.done, "each": EVERYWHERE,
            "of": {"part": "choice", "choice": ["default", *OTHER_RULES]}, "limit": "at least 90 %",
        },
        "rule": {
            "says": "One leg: in every world the error with another rule is at least a tenth smaller than with the "
            "paper's",
            "quantity": "least error of another rule over that of the paper's", "value": find_least_rule,
            "of": {"part": "choice"}, "each": EVERYWHERE, "limit": "at most 0.9",
        },
        "{choice}": {
            "for": {"choice": list(LEADS)},
            "says": "One leg: the error stays bounded with {choice} in every world",
            **STAYS, "of": {"part": "choice", "choice": "{choice}"},
        },
        "{chosen}": {
            "for": {"chosen": list(SETTINGS)},
            "says": "One leg with {chosen} ends as accurate as with the defaults in every world",
            "quantity": "final error with {chosen} over that with the defaults",
            "value": lambda runs: runs.end(TRANSFER),
            "of": {"part": "choice", "choice": "{chosen}"}, "over": {"choice": "default"}, "each": EVERYWHERE,
            "limit": "at most 1.25",
        },
    },
    figures={
        "auto": [
            {"metric": "transfer_rmse_y", "by": "world", "of": {"machine": machine, **AUTO}, "log": "y",
             "title": machine}
            for machine in MACHINES
        ]
    },
    tables={
        **{
            f"rates_{machine}": {"rows": {"learning.rate": "rate"}, "of": {"part": "rate", "machine": machine},
            **IN_MM}
            for machine in MACHINES
        },
        **{
            name: {"rows": "machine", "of": {"part": label}, **IN_MM}
            for name, label in (("lead", "lead 1"), ("wrong", "lead 1, guarded"), ("guarded", "auto, guarded"))
        },
        "choices": {"rows": "choice", "of": {"part": "choice"}, **IN_MM},
    },
)  # fmt: skip
