"""Learning beyond five cycles: which rules, leads and rates last, and whether drift and growth tell it in advance.

``python -m pipelines.long_learning`` runs every rule with several leads on one leg and on the quadruped, every rule
for ten thousand cycles, late actuators, other rates, and settings of the quadruped's force feedback.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from cmacexp.cli.study import main
from cmacexp.cmac.rules import RULES
from cmacexp.study import Request, Results, Study, grid
from pipelines import long_learning_figures as figures
from pipelines import long_learning_measures as measures
from pipelines.long_learning_findings import FELT, FINDINGS, RAMPED, RATES
from pipelines.long_learning_measures import FORCE, GRID, LATE, LEG, LONG, PAPER, RATE, SETTING, WALK

LEADS = (-1, 0, 1, 2)
DELAYS, DELAY_LEADS = (0, 1, 2), (0, 1, 2, 3, "auto")
THIN = "record.every_nth_step=600"
"""Metrics are of every step; of the traces little is kept."""
RAMP = "gait.load_ramp=0.12"
FEEDBACK = ("force_control.elasticity=0.001", "force_control.admittance=0.001")
"""Force feedback ten times the paper's."""
SETTINGS = {"as published": [], RAMPED: [RAMP], "force feedback": FEEDBACK, FELT: [RAMP, *FEEDBACK]}


def runs(quick: bool) -> list[Request]:
    """All parts, each for every seed."""
    rules, leads = (("paper", "weight_smoothing"), (0, 1)) if quick else (tuple(RULES), LEADS)

    def part(
        name: str, scenario: str, cycles: int, over: Mapping[str, Any], *more: str, **labels: str
    ) -> list[Request]:
        number = (40 if scenario == "one_leg" else 12) if quick else cycles
        common = (f"scenario={scenario}", f"cycles={number}", THIN, *more)
        return grid(*common, over=over, seeded=True, part=name, **labels)

    both = {"learning.rule": rules, "lead": {f"lead {lead}": [f"learning.lead={lead}"] for lead in leads}}
    late = {"actuator.delay": DELAYS[:2] if quick else DELAYS, "learning.lead": DELAY_LEADS}
    rates = {"learning.rate": RATES[2:4] if quick else RATES, "learning.lead": [0, 1]}
    return [
        *part(GRID, "one_leg", 2_000, both, machine=LEG),
        *part(GRID, "quadruped", 500, both, RAMP, machine=WALK),
        *part(LONG, "one_leg", 10_000, {"learning.rule": rules}, "learning.lead=1"),
        *part(LATE, "one_leg", 2_000, late),
        *part(RATE, "one_leg", 1_000, rates),
        *part(SETTING, "quadruped", 2_000, {"settings": SETTINGS}, "learning.lead=1"),
    ]


def values(results: Results) -> dict[str, Any]:
    """Cycles of each part, and settings that the page names."""
    asked = {part: f"{own.values('cycles')[0]:,}" for part, own in results.by("part").items()}
    published, felt = (results.select(settings=name) for name in ("as published", FELT))
    gain = "force_control.elasticity"
    return {
        "cycles": asked, "walk_cycles": results.select(part=GRID, machine=WALK).value("cycles"),
        "ramp": felt.value("gait.load_ramp"), "gain": felt.value(gain), "published_gain": published.value(gain),
        "seeds": len(results.values("seed")), "last": measures.LAST, "learnt": 1e3 * measures.LEARNT,
        "near": figures.NEAR,
    }  # fmt: skip


def _part(draw: Callable[[Results], Any], **settings: Any) -> Callable[[Results], Any]:
    return lambda results: draw(results.select(settings))


STUDY = Study(
    title="Learning beyond five cycles",
    question="With which rules, leads and rates does learning last, and how early can this be predicted?",
    runs=runs,
    measures={"detected": measures.detected},
    computed={"growth": measures.growth},
    findings=FINDINGS,
    figures={
        "leads": _part(figures.draw_leads, part=GRID, **PAPER),
        "rules": _part(figures.draw_rules, part=LONG),
        "growth": figures.draw_growth,
        "settings": _part(figures.draw_settings, part=SETTING),
    },
    tables={
        "leg": _part(figures.table_of_rules, part=GRID, machine=LEG),
        "walk": _part(partial(figures.table_of_rules, name=FORCE, factor=1.0), part=GRID, machine=WALK),
        "drift": _part(figures.table_of_drift, part=GRID, **PAPER),
        "growth": figures.table_of_growth,
        "late": _part(figures.table_of_delays, part=LATE),
        "rates": _part(figures.table_of_rates, part=RATE),
        "settings": _part(figures.table_of_settings, part=SETTING),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
