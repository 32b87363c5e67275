"""Alternatives to the CMAC: models, radial basis functions, a perceptron, iterative learning.

``python -m pipelines.feedforwards`` lets each of them learn the same steps of one leg and the same walk, then gives
what it has learnt another ground and another stroke. What it claims: what learns from the feedback gets far below a
model whose masses are 20 % off; on a path that repeats CMAC is neither the fastest nor the smallest. It takes some
minutes, most of them for the perceptron.
"""

from cmacexp.report.page import Drawing, Section, Text
from pipelines.analysis import feedforward_change as change
from pipelines.analysis import feedforward_words as words
from pipelines.analysis import figures_feedforward as figures
from pipelines.analysis.feedforward_cost import cost_table
from pipelines.analysis.feedforward_kinds import (
    CHANGES,
    FOUR_LEGS,
    KEPT,
    KINDS,
    LEARNERS,
    ONE_LEG,
    RATES,
    SMOOTH,
    courses,
    name_of,
    rate_group,
)
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

SEEDS = 5
COMMON = ("reference=aware", "learning.lead=1")
STEPS = {
    ONE_LEG: ("scenario=one_leg", 100, 6),
    FOUR_LEGS: ("scenario=quadruped", 40, 2),
    SMOOTH: ("scenario=one_leg gait.vertical=two_cubics", 40, 3),
}
"""Overrides of each group, its cycles, and those of its quick form."""
AFTER, QUICK_AFTER = 20, 3
"""Cycles after a change, and at each rate."""


def _jobs_of(group: str, kind: str, quick: bool, *more: str, seeds: int = SEEDS) -> dict[str, list[str]]:
    seeded = KINDS[kind].seeded
    numbers = range(1 if quick else seeds) if seeded else [0]
    return {
        name_of(group, kind, seed): [*COMMON, *KINDS[kind].overrides, *more, *([f"seed={seed}"] if seeded else [])]
        for seed in numbers
    }


def jobs(quick: bool) -> Jobs:
    """Every kind on one leg, on four and on a smooth path; learners at other rates, and fresh after a change."""
    runs: dict[str, list[str]] = {}
    for group, (overrides, cycles, quick_cycles) in STEPS.items():
        for kind in KINDS:
            kept = ["record.weights=true"] if group == ONE_LEG and KINDS[kind].learns else []
            more = [*overrides.split(), f"cycles={quick_cycles if quick else cycles}", *kept]
            runs |= _jobs_of(group, kind, quick, *more)
    after = f"cycles={QUICK_AFTER if quick else AFTER}"
    for rate in RATES[1:2] if quick else RATES:
        for kind in LEARNERS:
            runs |= _jobs_of(
                rate_group(rate), kind, quick, "scenario=one_leg", f"learning.rate={rate}", after, seeds=1
            )
    for name, overrides in CHANGES.items():
        for kind in KINDS:
            if kind in KEPT or not KINDS[kind].learns:
                runs |= _jobs_of(name, kind, quick, "scenario=one_leg", *overrides, after)
    return runs


def carried_over(quick: bool, runs: Runs) -> Jobs:
    """The same changes for learners that start from what they learnt on one leg."""
    after = f"cycles={QUICK_AFTER if quick else AFTER}"
    return {
        change.carried(name): [
            *overrides, "scenario=one_leg", after, "learning.start_cycle=1",
            f"learning.start_from='{runs[name.replace(group, ONE_LEG, 1)].folder}'",
        ]
        for group, changed in CHANGES.items()
        for kind in KEPT
        for name, overrides in _jobs_of(group, kind, quick, *changed).items()
    }  # fmt: skip


def summarise(runs: Runs) -> list[Section]:
    """Accuracy and speed on one leg and on four, then what each costs, and what a change does to it."""
    leg, walk, smooth = (courses(runs, group) for group in STEPS)
    cost = runs.keep("cost.parquet", cost_table(quick=len(next(iter(leg.values())).x[0]) < AFTER))
    return [
        Section(
            "One leg",
            [
                Text(words.READING),
                *words.accuracy(leg),
                Drawing("learning_one_leg", figures.learning(leg), words.learning_caption(leg)),
                Text(words.beaten(leg)),
                Text(words.advice_one_leg(leg)),
            ],
            words.claims(runs, leg, walk),
        ),
        Section(
            "Four legs",
            [
                *words.accuracy(walk, tilt=True),
                Drawing("learning_four_legs", figures.learning(walk), words.learning_caption(walk)),
                Text(words.beaten(walk)),
                Text(words.advice_four_legs(walk)),
            ],
            beyond=True,
        ),
        Section("A path without jumps", [*words.smooth(leg, smooth)], beyond=True),
        Section("Learning rate", [*words.rates(runs)], beyond=True),
        Section("Memory and time", [*words.costs(runs, cost, leg)], beyond=True),
        Section(
            "Another ground, another stroke",
            [
                *change.tables(runs),
                Drawing("after_a_change", figures.after(change.all_courses(runs)), change.CAPTION),
                Text(change.advice(runs)),
            ],
            [change.claim(runs)],
            beyond=True,
        ),
    ]


STUDY = Study(
    "feedforwards",
    "Alternatives to the CMAC",
    "Exact and wrong models, CMAC, radial basis functions, a perceptron and iterative learning control as the "
    "feedforward of one leg and of four: accuracy, speed of learning, memory, time, and what remains after a change.",
    jobs,
    summarise,
    carried_over,
)

if __name__ == "__main__":
    main(STUDY)
