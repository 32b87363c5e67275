"""Learning beyond five cycles: every rule with leads from -2 to 3, on one leg and under a body.

``python -m pipelines.long_learning`` runs 10,000 cycles of one leg and 500 of the quadruped, with actuators that are
none, one or two samples late, and other seeds of the hash. What it claims: the law as published drifts from some
cycle on and diverges, which its linearised loop predicts; it lasts if the feedback trains the cells of the
torque that caused it. It takes about ten minutes on two cores.
"""

from collections.abc import Sequence

from cmacexp.cmac.rules import RULES
from cmacexp.report.page import Drawing, Section, Text
from pipelines.analysis import long_learning_figures as figures
from pipelines.analysis import long_learning_words as words
from pipelines.analysis.long_learning_runs import Long, read
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

LEADS = (-2, -1, 0, 1, 2, 3)
DELAYS = (0, 1, 2)
SEEDS = (1, 2, 3, 4)
RATES = (0.05, 0.1, 0.1953125, 0.4, 0.8, 1.5)
"""The third is the paper's."""
THIN = "record.every_nth_step=600"
"""Metrics are of every step; of the traces of such runs little is kept."""
LEG, WALK, LATE, SEEDED, FAR, RATE = "one leg", "quadruped", "late actuator", "seeds", "settings", "rate"
RAMP = "gait.load_ramp=0.12"
FELT = ("force_control.elasticity=0.001", "force_control.admittance=0.001")
"""Force feedback ten times the paper's, with which learning sees an error of force."""
SETTINGS = {"as in the paper": (), "ramp": (RAMP,), "felt": FELT, "ramp, felt": (RAMP, *FELT)}


def _job(scenario: str, cycles: int, lead: int | str, *more: str) -> list[str]:
    return [f"scenario={scenario}", f"cycles={cycles}", f"learning.lead={lead}", THIN, *more]


def jobs(quick: bool) -> Jobs:
    """Rules by leads for both machines; delays by leads; seeds; settings of the quadruped."""
    leg, walk, far = (60, 12, 12) if quick else (10_000, 500, 2_000)
    rules, leads = (("paper", "weight_smoothing"), (0, 1)) if quick else (tuple(RULES), LEADS)
    runs = {
        f"{machine} {rule} {lead}": _job(scenario, cycles, lead, f"learning.rule={rule}", *more)
        for machine, scenario, cycles, more in ((LEG, "one_leg", leg, ()), (WALK, "quadruped", walk, (RAMP,)))
        for rule in rules
        for lead in leads
    }
    for delay in DELAYS[1:2] if quick else DELAYS:
        for rule in ("paper", "weight_smoothing"):
            for wanted in (0, 1, "auto") if quick else (*LEADS[2:], "auto"):
                more = (f"actuator.delay={delay}", f"learning.rule={rule}")
                runs[f"{LATE} {rule} {delay} {wanted}"] = _job("one_leg", leg, wanted, *more)
    for seed in SEEDS[:1] if quick else SEEDS:
        runs[f"{SEEDED} {LEG} {seed}"] = _job("one_leg", leg, 1, f"seed={seed}")
        runs[f"{SEEDED} {WALK} {seed}"] = _job("quadruped", walk, 1, f"seed={seed}", RAMP, *FELT)
    for rate in RATES[2:4] if quick else RATES:
        for lead in (0, 1):
            runs[f"{RATE} {rate:.3g}, lead {lead}"] = _job("one_leg", leg // 10, lead, f"learning.rate={rate}")
    for name, more in SETTINGS.items():
        for lead in (1,) if quick else (0, 1):
            runs[f"{FAR} {name}, lead {lead}"] = _job("quadruped", far, lead, *more)
    runs[f"{SEEDED} {LEG} 0"] = _job("one_leg", leg, 1)
    runs[f"{SEEDED} {WALK} 0"] = _job("quadruped", walk, 1, RAMP, *FELT)
    runs[f"aware {LEG}"] = _job("one_leg", leg, 1, "reference=aware")
    return runs


def _of(runs: Runs, kind: str) -> dict[str, Long]:
    return {name.removeprefix(f"{kind} "): read(run) for name, run in runs.items() if name.startswith(kind)}


def _machine(found: Sequence[Long], name: str) -> list[Drawing | Text]:
    """Figures of all rules of one machine."""
    return [
        Drawing(f"long_{name}", figures.over_cycles(found), words.of_cycles(found)),
        Drawing(f"ends_{name}", figures.ends(found), words.of_ends(found)),
    ]


def summarise(runs: Runs) -> list[Section]:
    """A section for each machine, late actuators, prediction, and seeds; each ends in advice."""
    leg, walk, late = (list(_of(runs, kind).values()) for kind in (LEG, WALK, LATE))
    far, seeds, rates = _of(runs, FAR), _of(runs, SEEDED), _of(runs, RATE)
    aware = read(runs[f"aware {LEG}"])
    growth = runs.keep("growth.parquet", words.growth_table([*leg, *(w for w in walk if w.rule == "paper")]))
    return [
        Section(
            "One leg, ten thousand cycles",
            [*_machine(leg, "leg"), words.table(leg), *words.advice_leg(leg, aware)],
            beyond=True,
        ),
        Section(
            "Drift is detected before a run diverges or falls",
            [Drawing("drift", figures.drift(leg), words.of_drift(leg)), words.advice_drift([*leg, *walk])],
            beyond=True,
        ),
        Section(
            "The end is predicted",
            [Drawing("growth", figures.growth(growth), words.of_growth(growth)), words.advice_growth(growth)],
            beyond=True,
        ),
        Section(
            "Late actuators",
            [Drawing("late", figures.late(late), words.of_late(late)), words.advice_late(late)],
            beyond=True,
        ),
        Section("Rate of learning", [words.rate_table(rates), words.advice_rate(rates)], beyond=True),
        Section(
            "Quadruped, five hundred cycles",
            [*_machine(walk, "walk"), words.table(walk), words.advice_walk(walk)],
            beyond=True,
        ),
        Section(
            "Quadruped: what its settings are worth",
            [Drawing("settings", figures.settings(far), words.of_settings(far)), *words.advice_settings(far)],
            beyond=True,
        ),
        Section("Seeds of the hash", [words.seeds_table(seeds), words.advice_seeds(seeds)], beyond=True),
    ]


STUDY = Study(
    "long_learning",
    "Learning beyond five cycles",
    "The law as published drifts and diverges, which its linearised loop predicts; with the right lead it "
    "lasts ten thousand cycles, on one leg and under a body.",
    jobs,
    summarise,
)

if __name__ == "__main__":
    main(STUDY)
