"""The benchmark as a study: its findings, tables and figures."""

from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any

import numpy as np

from cmacexp.study import (
    Array,
    Comparison,
    Criterion,
    DataFrame,
    Finding,
    Mask,
    Results,
    Study,
    at_least,
    at_most,
    quotients,
)
from pipelines.benchmark import summary
from pipelines.benchmark.entrants import (
    ALONE,
    CMAC,
    EACH_CYCLE,
    MACHINES,
    SPEED,
    STRESS,
    STROKE,
    TASKS,
    VERSION,
)
from pipelines.benchmark.results import BY_DEFAULT, FOR_ALL, FOR_EACH, GUARDED

BENCHMARK = "benchmark"
QUESTION = "How well do methods learn the torque of legs that press on the ground, when something changes for them?"
ON_MODEL, RBF, ILC, REPETITIVE = "CMAC on model", "RBF", "ILC", "repetitive control"
MODEL, HEAVY, SMOOTH, IDENTIFIED = "model", "model 20 % heavy", "model, smooth plan", "model, identified"
NOMINAL = (MODEL, "model 20 % light", HEAVY)
MODELS = (*NOMINAL, SMOOTH, IDENTIFIED)
LEARNERS = (CMAC, ON_MODEL, RBF, ILC, "MLP", "norm-optimal ILC", "Fourier features", "adaptive regressor", REPETITIVE)
FEW = 0.05
"""Largest share of failures that counts as small."""
AS_GOOD = 1.25
"""Largest ratio of two scores that counts as equally good."""
CLEARLY = 0.8
"""Largest ratio of two scores that counts as clearly better."""
SHARE = partial(Criterion, unit="%", scale=100.0)
SCORE = "mean score of the runs that both complete"
TABLES = {
    "scores": summary.table_scores,
    "tasks": summary.table_tasks,
    "costs": summary.table_costs,
}
"""Tables of each machine, by the start of their title."""


def _divide(sums: Array) -> Array:
    """Divide the first row of sums (2, worlds) by the second, (worlds,); ``UNPAIRED`` where no run counts."""
    return quotients(sums[0], np.where(sums[1] > 0.0, sums[1], np.inf))


def _ratio(machine: str, method: str, *rivals: str, setting: str = FOR_ALL) -> Callable[[Results], Array]:
    """Return a sample (worlds,): mean score of a method relative to that of the best rival in each world."""
    return summary.over_worlds(
        machine,
        lambda comparison: np.max([_divide(comparison.sums(method, name)) for name in rivals], axis=0),
        setting,
    )


def _failures(machine: str, methods: Sequence[str], setting: str = FOR_ALL) -> Callable[[Results], Mask]:
    """Return a sample (runs,) that is True for each run of the methods that failed."""
    return summary.over_worlds(
        machine, lambda comparison: ~np.array([comparison.completed(name) for name in methods]).ravel(), setting
    )


def _changed(results: Results, machine: str, kind: str, method: str = CMAC) -> Array:
    """Return the score of a method with a kind of setting relative to that with its default setting, (worlds,)."""
    frame = results.computed[BENCHMARK]
    before, after = (summary.make_comparison(frame, machine, setting) for setting in (BY_DEFAULT, kind))
    scores = {"before": before.scores[method], "after": after.scores[method]}
    return _divide(Comparison(scores, before.tasks, before.worlds).sums("after", "before"))


def _first(results: Results, machine: str, task: str) -> Array:
    """Return CMAC's first error after a change relative to feedback only, where both complete, (worlds,)."""
    rows = summary.take(results.computed[BENCHMARK], machine, FOR_ALL).query("task == @task")
    values = rows.pivot(index="world", columns="method", values="first_error")
    both = values[[CMAC, ALONE]].to_numpy().T
    return quotients(both[0], np.where(np.isfinite(both[0]), both[1], np.inf))


def _beaten(results: Results, method: str) -> Array:
    """Return the score of a learner relative to a rival's, on the machine where it is farthest behind, (worlds,).

    Machine and rival are chosen by every second world, and the ratio is taken in the other worlds.
    """
    frame = results.computed[BENCHMARK]
    machines = [summary.make_comparison(frame, machine, FOR_ALL) for machine in frame["machine"].unique()]
    pairs = [comparison.sums(method, rival) for comparison in machines for rival in LEARNERS if rival != method]
    farthest = max(pairs, key=lambda sums: _divide(sums[:, ::2].sum(axis=1, keepdims=True))[0])
    return _divide(farthest[:, 1::2])


def _findings(machine: str) -> dict[str, Finding]:
    """Return the findings on a machine; findings on tuning only where methods were tuned."""
    tuned = MACHINES[machine].draws > 0
    kind = "tuned for all tasks" if tuned else "default settings"
    findings = {
        f"learners_{machine}": Finding(
            [Criterion(f"{SCORE}, over that of the best model that is not identified, in each world, {kind}",
                        _ratio(machine, name, *NOMINAL), at_most(1.0), at_least(1.0), case=name)
             for name in LEARNERS],
            says=f"{machine}: every learner ends better than every model that is not identified",
        ),
        f"learners_identified_{machine}": Finding(
            [Criterion(f"{SCORE}, over that of the identified model, {kind}",
                        _ratio(machine, name, IDENTIFIED), at_most(1.0), at_least(1.0), case=name)
             for name in LEARNERS],
            says=f"{machine}: every learner ends better than the identified model",
        ),
        f"model_{machine}": Finding(
            [Criterion(f"{SCORE}, CMAC over a model", _ratio(machine, CMAC, name), at_most(CLEARLY), at_least(1.0),
                        case=name) for name in MODELS],
            says=f"{machine}: the CMAC ends clearly better than every model",
        ),
        f"identified_{machine}": Finding(
            [Criterion(f"{SCORE}, identified over nominal model", _ratio(machine, IDENTIFIED, MODEL),
                        at_most(CLEARLY), at_least(1.0))],
            says=f"{machine}: a model that is identified from two cycles is clearly better than the "
            "nominal one",
        ),
        f"each_cycle_{machine}": Finding(
            [Criterion(f"{SCORE}, CMAC over the model identified each cycle, {kind}",
                        _ratio(machine, CMAC, EACH_CYCLE), at_most(1.0), at_least(1.0))],
            says=f"{machine}: the CMAC ends better than a model that is identified from as many cycles",
        ),
        f"heavy_{machine}": Finding(
            [Criterion(f"{SCORE}, the model with masses 20 % too heavy over the nominal one",
                        _ratio(machine, HEAVY, MODEL), at_most(0.9), at_least(1.1))],
            says=f"{machine}: a model with masses 20 % too heavy is better than the nominal one, though "
            "the true masses lie evenly around it",
        ),
        f"smooth_{machine}": Finding(
            [Criterion(f"{SCORE}, the nominal model along a smooth plan over that along the plan",
                        _ratio(machine, SMOOTH, MODEL), at_most(CLEARLY), at_least(1.0))],
            says=f"{machine}: along a plan after a low-pass, which turns jumps of velocity into impulses, "
            "the nominal model is clearly better",
        ),
        f"rbf_{machine}": Finding(
            [Criterion(f"{SCORE}, RBF over CMAC, {kind}", _ratio(machine, RBF, CMAC), at_most(CLEARLY),
                        at_least(1.0))],
            says=f"{machine}: RBF ends clearly better than the CMAC",
        ),
        f"plain_{machine}": Finding(
            [Criterion(f"{SCORE}, ILC over CMAC, {kind}", _ratio(machine, ILC, CMAC), at_most(1.1),
                        at_least(AS_GOOD))],
            says=f"{machine}: where both complete, a torque for each sample of the cycle (ILC) ends as "
            "well as the CMAC",
        ),
        f"plain_fails_{machine}": Finding(
            [SHARE("runs that fail", _failures(machine, [name]), at_most(FEW), case=name) for name in (ILC, CMAC)],
            says=f"{machine}: neither ILC nor the CMAC fails often",
        ),
        f"carries_{machine}": Finding(
            [Criterion(f"first error after another {task} over that of feedback only, CMAC",
                        partial(_first, machine=machine, task=task), at_most(0.5), at_least(1.0))
             for task in (STROKE, SPEED)],
            says=f"{machine}: what the CMAC has learnt carries over to another stroke and speed",
        ),
        f"on_model_{machine}": Finding(
            [Criterion(f"{SCORE}, CMAC on the model over CMAC alone, default settings",
                        _ratio(machine, ON_MODEL, CMAC, setting=BY_DEFAULT), at_most(CLEARLY), at_least(1.0))],
            says=f"{machine}: on top of a model that is wrong the CMAC ends clearly better than alone",
        ),
        f"fails_{machine}": Finding(
            [SHARE("runs of learners that fail", _failures(machine, LEARNERS), at_most(FEW))],
            says=f"{machine}: hardly any learner fails in any task",
        ),
        f"guarded_{machine}": Finding(
            [SHARE(f"runs of learners that fail, {setting}", _failures(machine, LEARNERS, setting), at_most(limit))
             for setting, limit in ((GUARDED, FEW), (BY_DEFAULT, 1.0))],
            says=f"{machine}: with default settings and the guard hardly any learner fails",
        ),
        f"guard_costs_{machine}": Finding(
            [Criterion(f"{SCORE}, default settings with over without the guard",
                        partial(_changed, machine=machine, kind=GUARDED, method=name), at_most(1.1),
                        at_least(AS_GOOD), case=name) for name in LEARNERS],
            says=f"{machine}: the guard raises the error of no learner by more than a tenth",
        ),
    }  # fmt: skip
    return findings | (_findings_of_tuning(machine) if tuned else {})


def _findings_of_tuning(machine: str) -> dict[str, Finding]:
    return {
        f"tuning_{machine}": Finding(
            [Criterion(f"{SCORE}, CMAC with {kind} over its default setting",
                        partial(_changed, machine=machine, kind=kind), at_most(CLEARLY))
             for kind in (FOR_ALL, FOR_EACH)],
            says=f"{machine}: tuning lowers the score of the CMAC clearly, with one setting for all tasks "
            "and with one for each",
        ),
        f"overfits_{machine}": Finding(
            [Criterion(f"{SCORE}, RBF with {FOR_EACH} over its default setting",
                        partial(_changed, machine=machine, kind=FOR_EACH, method=RBF), at_least(1.1), at_most(1.0)),
             ],
            says=f"{machine}: tuned for each task in a few other worlds RBF ends worse than with its "
            "default setting",
        ),
        f"overfits_fails_{machine}": Finding(
            [SHARE("runs of RBF that fail", _failures(machine, [RBF], kind), at_least(FEW), at_most(FEW), case=kind)
             for kind in (FOR_EACH,)],
            says=f"{machine}: tuned for each task in a few other worlds RBF fails often",
        ),
    }  # fmt: skip


def _values(results: Results) -> dict[str, Any]:
    frame = results.computed[BENCHMARK]
    machines = [*frame["machine"].unique()]
    return {
        "machines": machines,
        "version": VERSION,
        "tasks": TASKS,
        "settings": MACHINES,
        "orders": {name: summary.describe_order(frame, name) for name in machines},
        "failed": len(summary.table_failures(frame)),
        "stress": STRESS,
    }


def _show(table: Callable[[DataFrame], DataFrame], results: Results) -> DataFrame:
    return table(results.computed[BENCHMARK])


def make_study(machines: Collection[str], methods: Collection[str]) -> Study:
    """Return the study of a benchmark of these machines and methods; findings need all methods of the benchmark."""
    findings: dict[str, Finding] = {}
    if {ALONE, EACH_CYCLE, *MODELS, *LEARNERS} <= {*methods}:
        findings = {key: finding for name in machines for key, finding in _findings(name).items()}
    if findings and {*machines} == {*MACHINES}:
        where = "on the machine where it is the farthest behind, which other worlds chose"
        findings["no_winner"] = Finding(
            [
                Criterion(
                    f"{SCORE}, over that of the best rival, {where}",
                    partial(_beaten, method=name),
                    at_least(1.0),
                    at_most(1.0),
                    case=name,
                )
                for name in LEARNERS
            ],
            says="No learner is the best one on all machines: on some machine each of them has a larger error than "
            "another one",
        )
    tables: dict[str, Callable[[DataFrame], DataFrame]] = {
        "failures": summary.table_failures,
        "absolute": summary.table_absolute,
        **{f"{title} {name}": partial(table, machine=name) for name in machines for title, table in TABLES.items()},
    }
    return Study(
        title="Learned feedforward under contact",
        question=QUESTION,
        runs=lambda quick: [],
        findings=findings,
        figures={"profiles": lambda results: summary.draw_profiles(results.computed[BENCHMARK])},
        tables={title: partial(_show, table) for title, table in tables.items()},
        values=lambda results: {**_values(results), "findings": list(findings)},
    )
