"""Settings of learning tried again where feedback is late: lead, rate, rule, size of the CMAC, path, guard.

``python -m pipelines.late_learning`` repeats the choices that `docs/how-to-choose.md` recommends with encoders, late
torques and lags, over more cycles than the studies that recommend them.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

from cmacexp.cmac.rules import PAPER_RATE, RULES
from cmacexp.metrics.final import FINAL_CYCLES, TRANSFER
from cmacexp.study import (
    Criterion,
    Figure,
    Finding,
    Request,
    Results,
    Study,
    at_least,
    at_most,
    draw,
    grid,
)
from cmacexp.study.curves import over_cycles
from cmacexp.study.samples import per_seed, relative
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines.common_results import find_least, percent, tabulate_ends

ON_TIME, LATE_TORQUE = "on time", "torque two samples late"
WORLDS = {
    ON_TIME: (),
    "encoders": ("sensors=encoders",),
    LATE_TORQUE: ("actuator.delay=2",),
    "lag of 5 ms": ("actuator.lag=0.005",),
    "lag of 15 ms": ("actuator.lag=0.015",),
}
LEG, WALK = "one leg", "quadruped"
MACHINES = {LEG: ("scenario=one_leg", "learning=lasting"), WALK: ("scenario=quadruped_lasting",)}
UNGUARDED = "learning.guard=none"
RATE, LEAD, WRONG, GUARDED, CHOICE = "rate", "lead 1", "lead 1, guarded", "auto, guarded", "choice"
"""The parts of the study."""
FASTEST = 0.8
RATES = ("auto", 0.05, PAPER_RATE, 0.4, FASTEST)
ONE = ("learning.lead=1", f"learning.rate={PAPER_RATE}")
"""Right where feedback is on time."""
DEFAULT = "default"
OTHER_RULES = {f"rule {rule}": (f"learning.rule={rule}",) for rule in RULES if rule != "paper"}
SETTINGS = {
    "angles alone": ("cmac.inputs=[angle]",),
    "9 resolution elements": ("cmac.resolution_elements=9",),
    "8 layers": ("cmac.layers=8",),
    "128 layers": ("cmac.layers=128",),
    "path without jumps": ("gait.vertical=two_cubics",),
}
LEADS = {f"zero_phase, lead {lead}": ("learning.rule=zero_phase", f"learning.lead={lead}") for lead in (3, 1)}
"""The longest lead that is right in one of these worlds, and the shortest."""
CHOICES = {DEFAULT: (), **SETTINGS, **OTHER_RULES, **LEADS}
"""Of one leg."""
CYCLES, QUICK_CYCLES = 300, 4
HELD, AS_GOOD, HARMLESS = 1.5, 1.25, 1.05
"""Final error over the least of the run up to which learning holds, over another one as good, over feedback only."""


def runs(quick: bool) -> list[Request]:
    """Every part in every world; the quick form is of two worlds and the first choices."""
    worlds = {name: WORLDS[name] for name in ((ON_TIME, LATE_TORQUE) if quick else WORLDS)}
    rates = (RATES[0], RATES[-1]) if quick else RATES
    choices = dict(list(CHOICES.items())[:2]) if quick else CHOICES

    def part(name: str, machines: dict[str, Any], *words: str, **over: Any) -> list[Request]:
        kept = (f"cycles={QUICK_CYCLES if quick else CYCLES}", "record.cycles=[1]", *words)
        return grid(*kept, over={"machine": machines, "world": worlds, **over}, seeded=True, part=name)

    leg = {LEG: MACHINES[LEG]}
    return [
        *part(RATE, MACHINES, UNGUARDED, **{"learning.rate": rates}),
        *part(LEAD, MACHINES, UNGUARDED, *ONE),
        *part(WRONG, MACHINES, *ONE),
        *part(GUARDED, MACHINES),
        *part(CHOICE, leg, UNGUARDED, choice=choices),
    ]


def over_least(results: Results) -> Array:
    """(runs,): final error over the least median of as many cycles in a row; infinite of a run that ended before."""
    return results.end(TRANSFER) / [find_least(error, FINAL_CYCLES) for error in results.history(TRANSFER)]


def _least_rule(results: Results) -> Array:
    """(seeds,): least final error of the other rules over that of the paper's."""
    others, error = results.select(choice=list(OTHER_RULES)), partial(Results.end, name=TRANSFER)
    return per_seed(others, relative(others, results.select(choice=DEFAULT), error), min)


def _by_world(
    quantity: str, sample: Any, limit: Limit, over: Mapping[str, Any] | None = None, **of: Any
) -> list[Criterion]:
    """A criterion for each world, in their order."""
    return [Criterion(quantity, sample, limit, of={**of, "world": each}, case=each, over=over) for each in WORLDS]


def _done(what: str, **of: Any) -> list[Criterion]:
    quantity = f"cycles done of those asked for, {what}"
    return [percent(quantity, "done", at_least(0.9), case=each, world=each, **of) for each in WORLDS]


AUTO: dict[str, Any] = {"learning.rate": "auto"}
OVER_FIRST = f"{TRANSFER} / {TRANSFER}[1]"
IN_MM, BY_WORLD = f"1e3 * {TRANSFER}", ("world", "")
FINDINGS = {
    **{
        f"{name}_{machine}": Finding(
            _by_world("final error over the least", over_least, at_most(HELD), machine=machine, **of),
            says=f"{machine.capitalize()}: the error stays bounded with {what} in every world",
        )
        for machine in MACHINES
        for name, what, of in (
            ("auto", "lead and rate `auto`, unguarded,", {"part": RATE, **AUTO}),
            ("guarded", "lead and rate `auto`, guarded,", {"part": GUARDED}),
        )
    },
    **{
        f"{name}_{machine}": Finding(
            _done(what, machine=machine, **of),
            says=f"{machine.capitalize()}: runs complete with {what} in every world",
        )
        for machine in MACHINES
        for name, what, of in (
            ("fastest", f"rate {FASTEST}", {"part": RATE, "learning.rate": FASTEST}),
            ("fast", "rate 0.4", {"part": RATE, "learning.rate": 0.4}),
            ("lead", "lead 1 at the paper's rate", {"part": LEAD}),
        )
    },
    "paper_rate": Finding(
        _by_world(
            "final error with the paper's rate over that with rate auto",
            TRANSFER, at_most(AS_GOOD), AUTO, part=RATE, machine=LEG, **dict[str, Any]({"learning.rate": PAPER_RATE}),
        ),
        says="With the right lead the error of one leg with the paper's rate is at most 1.25 times "
            "that with `auto` in every world",
    ),
    **{
        f"wrong_{machine}": Finding(
            _by_world("final error over feedback only", OVER_FIRST, at_most(HARMLESS), part=WRONG, machine=machine),
            says=f"{machine.capitalize()}: guarded learning with lead 1 ends no worse than feedback only in "
            "every world",
        )
        for machine in MACHINES
    },
    "rules": Finding(
        _done("every rule", part=CHOICE, choice=[DEFAULT, *OTHER_RULES]),
        says="One leg completes with every rule in every world",
    ),
    "rule": Finding(
        _by_world("least error of another rule over that of the paper's", _least_rule, at_most(0.9), part=CHOICE),
        says="One leg: in every world the error with another rule is at least a tenth smaller than "
            "with the paper's",
    ),
    **{
        choice: Finding(
            _by_world("final error over the least", over_least, at_most(HELD), part=CHOICE, choice=choice),
            says=f"One leg: the error stays bounded with {choice} in every world",
        )
        for choice in LEADS
    },
    **{
        choice: Finding(
            _by_world(f"final error with {choice} over that with the defaults", TRANSFER, at_most(AS_GOOD),
                      {"choice": DEFAULT}, part=CHOICE, choice=choice),
            says=f"One leg with {choice} ends as accurate as with the defaults in every world",
        )
        for choice in SETTINGS
    },
}  # fmt: skip


def draw_rates(results: Results) -> Figure:
    """Transfer error in y over the cycles with `auto` in every world, for each machine."""
    chosen = results.select(AUTO, part=RATE)
    return draw(
        [
            over_cycles(own, "transfer_rmse_y", "world", log="y", title=name)
            for name, own in chosen.by("machine").items()
        ]
    )


def values(results: Results) -> dict[str, Any]:
    """Counts and settings that the page names."""
    return {"cycles": results.values("cycles")[0], "last": FINAL_CYCLES, "seeds": len(results.values("seed"))}


STUDY = Study(
    title="Learning with delayed feedback",
    question="Do the lead, rate, rule, size and path that suit feedback without delay also suit delayed feedback?",
    runs=runs,
    findings=FINDINGS,
    figures={"auto": draw_rates},
    tables={
        **{
            f"rates_{machine}": tabulate_ends(
                IN_MM, ("learning.rate", "rate"), BY_WORLD, {"part": RATE, "machine": machine}
            )
            for machine in MACHINES
        },
        **{
            name: tabulate_ends(IN_MM, ("machine", "machine"), BY_WORLD, {"part": part})
            for name, part in (("lead", LEAD), ("wrong", WRONG), ("guarded", GUARDED))
        },
        "choices": tabulate_ends(IN_MM, ("choice", "choice"), BY_WORLD, {"part": CHOICE}),
    },
    values=values,
)
