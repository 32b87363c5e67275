"""Learning over many cycles: which rules, leads and rates last, and whether drift and growth predict it.

``python -m pipelines.long_learning`` runs every rule with several leads on one leg and on the quadruped, every rule
for very long, late actuators, other rates, and settings of the quadruped's force feedback.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.cmac.rules import RULES
from cmacexp.commands.study import main
from cmacexp.study import Criterion, Finding, Panel, Request, Results, Series, Study, at_least, at_most, draw, grid
from cmacexp.study.curves import over_cycles
from cmacexp.study.samples import ended_in, per_seed, relative, share_done
from cmacexp.study.statements import percent
from cmacexp.study.tables import cross_tabulate, describe_end
from cmacexp.typing import Array
from pipelines import long_learning_measures as measures
from pipelines.long_learning_measures import FORCE, GRID, LEG, PAPER, TRANSFER, WALK, final

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONG, LATE, RATE, SETTING = "long", "late", "rates", "settings"
"""Parts of the study besides GRID: column ``part``."""
RATES = (0.05, 0.1, 0.1953125, 0.4, 0.8, 1.5)
PAPER_RATE, FASTEST = RATES[2], RATES[-1]
THIN = "record.every_nth_step=600"
"""Metrics are of every step; of the traces little is kept."""
RAMP = "gait.load_ramp=0.12"
FEEDBACK = ("force_control.elasticity=0.001", "force_control.admittance=0.001")
"""Force feedback ten times the paper's."""
PUBLISHED, RAMPED, FELT = "as published", "ramp", "ramp, force feedback"
SETTINGS = {PUBLISHED: [], RAMPED: [RAMP], "force feedback": FEEDBACK, FELT: [RAMP, *FEEDBACK]}
NEAR = 0.01
"""Difference of two growths up to which one predicts the other."""


def runs(quick: bool) -> list[Request]:
    """All parts, each for every seed."""
    rules, leads = (("paper", "weight_smoothing"), (0, 1)) if quick else (tuple(RULES), (-1, 0, 1, 2))

    def part(
        name: str, scenario: str, cycles: int, over: Mapping[str, Any], *more: str, **labels: str
    ) -> list[Request]:
        number = (40 if scenario == "one_leg" else 12) if quick else cycles
        common = (f"scenario={scenario}", f"cycles={number}", THIN, *more)
        return grid(*common, over=over, seeded=True, part=name, **labels)

    both = {"learning.rule": rules, "lead": {f"lead {lead}": [f"learning.lead={lead}"] for lead in leads}}
    late = {"actuator.delay": (0, 1) if quick else (0, 1, 2), "learning.lead": (0, 1, 2, 3, "auto")}
    rates = {"learning.rate": RATES[2:4] if quick else RATES, "learning.lead": [0, 1]}
    return [
        *part(GRID, "one_leg", 2_000, both, machine=LEG),
        *part(GRID, "quadruped", 500, both, RAMP, machine=WALK),
        *part(LONG, "one_leg", 10_000, {"learning.rule": rules}, "learning.lead=1"),
        *part(LATE, "one_leg", 2_000, late),
        *part(RATE, "one_leg", 1_000, rates),
        *part(SETTING, "quadruped", 2_000, {"settings": SETTINGS}, "learning.lead=1"),
    ]


def _least_of_others(results: Results, lead: int, name: str) -> Array:
    """(seeds,): least error at the end of the other rules with a lead, over the paper's rule with lead 1."""
    own = results.select(PAPER, lead="lead 1")
    others = results.select({"learning.rule": [rule for rule in RULES if rule != "paper"], "learning.lead": lead})
    return per_seed(others, relative(others, own, partial(final, name=name)), min)


def _one_less(results: Results) -> Array:
    """(runs,): share done with a lead of a sample less than from torque to feedback."""
    chosen = [row for row in results.rows if row.settings["learning.lead"] == row.settings["actuator.delay"]]
    return share_done(Results(chosen))


def _at_other_rates(results: Results) -> Array:
    """(seeds,): largest error at the end over that with the paper's rate."""
    return per_seed(results, relative(results, results.select({"learning.rate": PAPER_RATE}), final), max)


def _with_feedback(results: Results) -> Array:
    """(seeds,): force error at the end with stronger force feedback over that without."""
    felt, ramped = (results.select(settings=name) for name in (FELT, RAMPED))
    return relative(felt, ramped, partial(final, name=FORCE))


WARNED = {"part": [GRID, LATE, RATE]}


def _paper(machine: str, lead: int) -> dict[str, Any]:
    return {"part": GRID, "machine": machine, "learning.lead": lead, **PAPER}


def _ends(what: str, of: Mapping[str, Any], sample: Any = share_done) -> Criterion:
    return percent(f"cycles done of those asked for, {what}", sample, at_most(0.9), of=of)


def _steady(what: str, of: Mapping[str, Any], name: str = TRANSFER) -> Criterion:
    quantity = f"largest error over the least in the second half of the run, {what}"
    return Criterion(quantity, partial(measures.variation, name=name), at_most(1.25), of=of)


def _others(what: str, lead: int, name: str, machine: str, limit: float) -> Criterion:
    quantity = f"least {what} of the other rules with lead {lead} over that of the paper's rule"
    sample, of = partial(_least_of_others, lead=lead, name=name), {"part": GRID, "machine": machine}
    return Criterion(quantity if lead else f"{quantity} with lead 1", sample, at_most(limit), of=of)


FINDINGS = {
    "lead": Finding(
        [
            *(_ends(f"{machine}, lead 0", _paper(machine, 0)) for machine in (LEG, WALK)),
            _steady("one leg, lead 1", {"part": LONG, **PAPER}),
        ],
        yes="With lead 0, as published, the paper's rule does not last: one leg ends after {value} of its cycles, "
        "the quadruped after {values[1]}. With lead 1 it lasts on one leg.",
        no="The lead alone does not decide whether the paper's rule lasts: with lead 0 one leg completes {value} of "
        "its cycles and the quadruped {values[1]}; with lead 1 errors of one leg vary {values[2]}-fold in the second "
        "half.",
    ),
    "body": Finding(
        [_steady("force", _paper(WALK, 1), FORCE)],
        yes="Lead 1 is enough under a body too: force errors vary by a factor of {value} in the second half.",
        no="Lead 1 alone is not enough under a body: force errors vary by a factor of {value} in the second half.",
    ),
    **{
        f"rules_{machine}": Finding(
            [_others(f"{what} error", 1, name, machine, 0.9)],
            yes=f"With lead 1 ({machine}) another rule leaves {{value}} times the {what} error of the paper's.",
            no=f"With lead 1 ({machine}) no other rule leaves a {what} error smaller by a tenth than the paper's.",
        )
        for machine, what, name in ((LEG, "transfer", TRANSFER), (WALK, "force", FORCE))
    },
    "substitute": Finding(
        [_others("error", 0, TRANSFER, LEG, 1.1)],
        yes="On one leg a rule can replace the right lead: with lead 0 one leaves {value} times the error of the "
        "paper's rule with lead 1.",
        no="On one leg no rule replaces the right lead: with lead 0 the least error of any other is {value} times "
        "that of the paper's rule with lead 1.",
    ),
    "late": Finding(
        [_steady("auto", {"part": LATE, "learning.lead": "auto"}), _ends("one less", {"part": LATE}, _one_less)],
        yes="The lead must not be less than the number of samples from torque to feedback, which "
        "`learning.lead=auto` counts: with one less, runs end after {values[1]} of their cycles.",
        no="The number of samples from torque to feedback does not decide: with `learning.lead=auto` errors vary "
        "{value}-fold in the second half; with one less, runs complete {values[1]} of their cycles.",
    ),
    "rate": Finding(
        [
            Criterion(
                "largest error at the end with another rate over that with the paper's, lead 1",
                _at_other_rates,
                at_most(1.1),
                of={"part": RATE, "learning.rate": list(RATES[:-1]), "learning.lead": 1},
            ),
            _ends(f"rate {FASTEST}, lead 1", {"part": RATE, "learning.lead": 1, "learning.rate": FASTEST}),
        ],
        yes=f"With lead 1, no rate up to {RATES[-2]} ends with a clearly larger error; with {FASTEST} one leg ends "
        "after {values[1]} of its cycles.",
        no=f"With lead 1, rates up to {RATES[-2]} end with up to {{value}} times the error of the paper's; with "
        f"{FASTEST} one leg completes {{values[1]}} of its cycles.",
    ),
    "settings": Finding(
        [
            Criterion(
                "force error at the end with ramp and stronger force feedback, over that with the ramp alone",
                _with_feedback,
                at_most(0.5),
                of={"part": SETTING},
            ),
            _steady("force, with both", {"part": SETTING, "settings": FELT}, FORCE),
        ],
        yes="Stronger force feedback keeps the quadruped's force error small: {value} times that without it. "
        "`scenario=quadruped_lasting` has these settings.",
        no="Stronger force feedback does not keep the quadruped's force error small: it is {value} times that "
        "without, and varies {values[1]}-fold.",
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
        yes="Drift is detected in {value} of the runs that diverge or fall, when errors are {values[1]} times their "
        "least: learning can be stopped in time.",
        no="Drift is no sufficient warning: it is detected in {value} of the runs that diverge or fall, when errors "
        "are {values[1]} times their least.",
    ),
    **{
        f"growth_{machine}": Finding(
            [
                Criterion(
                    f"largest distance of predicted from measured growth per cycle, paper's rule, {machine}",
                    partial(measures.growth_miss, machine=machine),
                    at_most(NEAR),
                )
            ],
            yes=f"For the paper's rule ({machine}) the linearised loop predicts the growth per cycle to within "
            "{value} with every lead: `python -m cmacexp.stability` computes it without a long run.",
            no=f"For the paper's rule ({machine}) the linearised loop misses the growth per cycle by up to "
            "{value}: the prediction does not replace a long run.",
        )
        for machine in (LEG, WALK)
    },
}


RULE_ERRORS = {"transfer_rmse_x": "transfer error in x", "transfer_rmse_y": "transfer error in y"}
WALK_ERRORS = {FORCE: "force error", "tilt_max": "largest tilt"}


def _curves(results: Results, names: Mapping[str, str], by: str, before: str = "") -> list[Panel]:
    """Metrics over cycles, by their titles."""
    panels = {title: over_cycles(results, name, by, log="xy", title=title) for name, title in names.items()}
    return [replace(panel, title=before + title) for title, panel in panels.items()]


def draw_leads(results: Results) -> "Figure":
    """The paper's rule with every lead, on both machines."""
    names = {"transfer_rmse_y": "transfer error in y", "feedback_change": "change of the feedback"}
    machines = results.by("machine").items()
    return draw([panel for machine, own in machines for panel in _curves(own, names, "lead", f"{machine}: ")])


def draw_growth(results: Results) -> "Figure":
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


def _by_lead(results: Results, key: str, title: str, cell: Any) -> Any:
    return cross_tabulate(results, (key, title), ("learning.lead", "lead"), cell)


def _transfer(results: Results) -> str:
    return describe_end(results, 1e3 * final(results))


def _drift(results: Results) -> str:
    medians = {"detected": np.median(results.measure("detected")), "ended": np.median(ended_in(results))}
    return "; ".join(f"{what} in {cycle:.0f}" for what, cycle in medians.items() if np.isfinite(cycle)) or "-"


def values(results: Results) -> dict[str, Any]:
    """Cycles of each part, and settings that the page names."""
    asked = {part: f"{own.values('cycles')[0]:,}" for part, own in results.by("part").items()}
    published, felt = (results.select(settings=name) for name in (PUBLISHED, FELT))
    gain = "force_control.elasticity"
    return {
        "cycles": asked, "walk_cycles": results.select(part=GRID, machine=WALK).value("cycles"),
        "ramp": felt.value("gait.load_ramp"), "gain": felt.value(gain), "published_gain": published.value(gain),
        "seeds": len(results.values("seed")), "last": measures.LAST, "near": NEAR,
    }  # fmt: skip


STUDY = Study(
    title="Learning over many cycles",
    question="With which rules, leads and rates does learning last, and how early can this be predicted?",
    runs=runs,
    measures={"detected": measures.detected},
    computed={"growth": measures.growth},
    findings=FINDINGS,
    figures={
        "leads": lambda r: draw_leads(r.select(PAPER, part=GRID)),
        "rules": lambda r: draw(_curves(r.select(part=LONG), RULE_ERRORS, "learning.rule")),
        "growth": draw_growth,
        "settings": lambda r: draw(_curves(r.select(part=SETTING), WALK_ERRORS, "settings")),
    },
    tables={
        "leg": lambda r: _by_lead(r.select(part=GRID, machine=LEG), "learning.rule", "rule", _transfer),
        "walk": lambda r: _by_lead(
            r.select(part=GRID, machine=WALK),
            "learning.rule",
            "rule",
            lambda own: describe_end(own, final(own, FORCE)),
        ),
        "drift": lambda r: _by_lead(r.select(PAPER, part=GRID), "machine", "machine", _drift),
        "late": lambda r: _by_lead(r.select(part=LATE), "actuator.delay", "delay, samples", _transfer),
        "rates": lambda r: _by_lead(r.select(part=RATE), "learning.rate", "rate", _transfer),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
