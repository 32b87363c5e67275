"""The page of the benchmark: its tables, figures and findings."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from cmacexp.study import Finding, Results, Study, at_least, at_most
from cmacexp.study.comparison import Comparison
from cmacexp.study.statements import Criterion
from cmacexp.typing import Array
from pipelines.benchmark import summary
from pipelines.benchmark.entrants import ALONE, CMAC
from pipelines.benchmark.results import BY_DEFAULT, FOR_ALL, FOR_EACH
from pipelines.benchmark.tasks import LEG, MACHINES, QUADRUPED, SPEED, STROKE, TASKS, VERSION
from pipelines.common_results import percent

NAME = "benchmark"
TITLE = "Learned feedforward under contact"
QUESTION = "How well do methods learn the torque of legs that press on the ground, when something changes for them?"
ON_MODEL, RBF, ILC, MODEL, HEAVY = "CMAC on model", "RBF", "ILC", "model", "model 20 % heavy"
MODELS = (MODEL, "model 20 % light", HEAVY)
LEARNERS = (CMAC, ON_MODEL, RBF, ILC, "MLP", "norm-optimal ILC", "Fourier features", "adaptive regressor",
            "repetitive control")  # fmt: skip
FEW, AS_GOOD, CLEARLY = 0.05, 1.25, 0.8
"""Share of failures that is small; ratios of scores or cycles that count as as good, and as clearly less."""


def _by_world(scores: Array) -> Array:
    """(worlds,): mean of capped scores over the tasks."""
    return np.fmin(scores, 1.0).mean(axis=0)


def _ratio(machine: str, one: str, other: str, setting: str = FOR_ALL) -> Callable[[Results], Array]:
    def compute(comparison: Comparison) -> Array:
        return _by_world(comparison.scores[one]) / _by_world(comparison.scores[other])

    return summary.over_worlds(machine, compute, setting)


def _failures(comparison: Comparison) -> Array:
    """(worlds,): share of runs of learners that failed."""
    failed: Array = np.isinf([comparison.scores[name] for name in LEARNERS]).mean(axis=(0, 1))
    return failed


def _tuned(results: Results, machine: str, kind: str, method: str = CMAC) -> Array:
    """(worlds,): score of a method with a kind of setting over that with its default one."""
    frame = results.computed[NAME]
    after, before = (summary.make_comparison(frame, machine, each).scores[method] for each in (kind, BY_DEFAULT))
    return _by_world(after) / _by_world(before)


def _fastest(results: Results, machine: str) -> Array:
    """(worlds,): cycles to a tenth of CMAC over those of the fastest other learner, medians over the tasks."""
    counted = summary.count_cycles(summary.take(results.computed[NAME], machine, FOR_ALL))
    middle = {name: np.median(counted[name], axis=0) for name in LEARNERS}
    others = min((middle[name] for name in LEARNERS if name not in (CMAC, ON_MODEL)), key=np.mean)
    with np.errstate(invalid="ignore"):
        found: Array = middle[CMAC] / others
    return np.where(np.isnan(found), 1.0, found)


def _first(results: Results, machine: str, task: str) -> Array:
    """(worlds,): first error of CMAC after a change over that of feedback alone."""
    rows = summary.take(results.computed[NAME], machine, FOR_ALL)
    values = summary.tabulate_values(rows, "first_error", (task,))
    found: Array = values[CMAC][0] / values[ALONE][0]
    return found


SCORE = "mean score over the tasks"


def _findings(machine: str) -> dict[str, Finding]:
    return {
        f"on_model_{machine}": Finding(
            [Criterion(f"{SCORE}, CMAC on the model over CMAC alone, default settings",
                       _ratio(machine, ON_MODEL, CMAC, BY_DEFAULT), at_most(CLEARLY), at_least(1.0))],
            yes=f"{machine}: on top of a model that is wrong the CMAC ends clearly better than alone "
                "({value} of its score).",
            no=f"{machine}: on top of a model that is wrong the CMAC does not end clearly better than alone "
               "({value} of its score).",
        ),
        f"model_{machine}": Finding(
            [Criterion(f"{SCORE}, CMAC over {name}", _ratio(machine, CMAC, name), at_most(CLEARLY), at_least(1.0))
             for name in MODELS],
            yes=f"{machine}: the CMAC ends clearly better than every model ({{value}} of the score of the model).",
            no=f"{machine}: the CMAC does not end clearly better than every model ({{value}} of the score of the "
               "model).",
        ),
        f"rapid_{machine}": Finding(
            [Criterion("cycles to a tenth, CMAC over the fastest other learner that has no model",
                       partial(_fastest, machine=machine), at_most(AS_GOOD))],
            yes=f"{machine}: after a change the CMAC is about as fast as the fastest other learner, or faster "
                "({value} of its cycles).",
            no=f"{machine}: after a change the CMAC is slower than the fastest other learner ({{value}} times its "
               "cycles).",
        ),
        f"tuning_{machine}": Finding(
            [Criterion(f"{SCORE} of CMAC, {kind}, over that of its default setting",
                       partial(_tuned, machine=machine, kind=kind), at_most(CLEARLY))
             for kind in (FOR_ALL, FOR_EACH)],
            yes=f"{machine}: tuning lowers the score of the CMAC clearly: to {{value}} with one setting for all "
                "tasks, to {values[1]} with one for each.",
            no=f"{machine}: tuning does not lower the score of the CMAC clearly: to {{value}} with one setting for "
               "all tasks, to {values[1]} with one for each.",
        ),
        f"plain_{machine}": Finding(
            [Criterion(f"{SCORE}, ILC over CMAC, both tuned", _ratio(machine, ILC, CMAC), at_most(1.1),
                       at_least(AS_GOOD))],
            yes=f"{machine}: a torque for each sample of the cycle, tuned, ends as well as the CMAC "
                "({value} of its score).",
            no=f"{machine}: a torque for each sample of the cycle, tuned, does not end as well as the CMAC "
               "({value} of its score).",
        ),
        f"heavy_{machine}": Finding(
            [Criterion(f"{SCORE}, the model with masses 20 % too heavy over the model", _ratio(machine, HEAVY, MODEL),
                       at_most(0.9), at_least(1.1))],
            yes=f"{machine}: a model with masses 20 % too heavy is better than the one that the designer believes, "
                "though the true masses lie evenly around it ({value} of its score).",
            no=f"{machine}: a model with masses 20 % too heavy is not clearly better than the one that the designer "
               "believes ({value} of its score).",
        ),
        f"overfits_{machine}": Finding(
            [Criterion(f"{SCORE} of RBF, {FOR_EACH}, over that of its default setting",
                       partial(_tuned, machine=machine, kind=FOR_EACH, method=RBF), at_least(1.1), at_most(1.0))],
            yes=f"{machine}: tuned for each task in a few other worlds RBF ends worse than with its default setting "
                "({value} times its score).",
            no=f"{machine}: tuned for each task in a few other worlds RBF does not end worse than with its default "
               "setting ({value} times its score).",
        ),
        f"carries_{machine}": Finding(
            [Criterion(f"first error after another {task} over that of feedback alone, CMAC",
                       partial(_first, machine=machine, task=task), at_most(0.5), at_least(1.0))
             for task in (STROKE, SPEED)],
            yes=f"{machine}: what the CMAC has learnt carries over to another stroke and speed: in the first cycle "
                "it leaves {value} and {values[1]} of the error of feedback alone.",
            no=f"{machine}: what the CMAC has learnt does not carry over to another stroke and speed: in the "
               "first cycle it leaves {value} and {values[1]} of the error of feedback alone.",
        ),
        f"fails_{machine}": Finding(
            [percent("runs of learners that fail", summary.over_worlds(machine, _failures), at_most(FEW))],
            yes=f"{machine}: hardly any learner fails in any task: {{value}} of the runs.",
            no=f"{machine}: learners fail: {{value}} of the runs.",
        ),
    }  # fmt: skip


def _values(results: Results) -> dict[str, Any]:
    frame = results.computed[NAME]
    machines = summary.machines_of(frame)
    return {
        "machines": machines,
        "version": VERSION,
        "tasks": TASKS,
        "methods": [name for name in frame["method"].unique()],
        "settings": MACHINES,
        "orders": {name: summary.describe_order(frame, name, summary.find_setting(name)) for name in machines},
        "excluded": {name: summary.make_comparison(frame, name, BY_DEFAULT).excluded for name in machines},
        "failed": len(summary.table_failures(frame)),
        "has_cmac": CMAC in set(frame["method"]),
        "stressed": bool(len(summary.stress(frame))),
    }


def make_study(machines: Mapping[str, Any], methods: list[str]) -> Study:
    """The study of a benchmark of these machines and methods; findings need all methods of the benchmark."""
    whole = {ALONE, *MODELS, *LEARNERS} <= set(methods)
    judged = [name for name in (LEG, QUADRUPED) if name in machines and whole]
    findings = {key: finding for name in judged for key, finding in _findings(name).items()}
    tables: dict[str, Any] = {"failures": lambda results: summary.table_failures(results.computed[NAME])}
    for name in machines:
        tables[f"scores {name}"] = lambda r, name=name: summary.table_scores(r.computed[NAME], name)
        if CMAC in methods:
            tables[f"statistics {name}"] = lambda r, name=name: summary.table_statistics(r.computed[NAME], name)
        tables[f"tasks {name}"] = lambda r, name=name: summary.table_tasks(r.computed[NAME], name)
        tables[f"costs {name}"] = lambda r, name=name: summary.table_costs(
            r.computed[NAME], r.computed["costs"], name
        )
    tables["settings"] = lambda results: results.computed["settings"]
    tables["stress"] = lambda results: summary.stress(results.computed[NAME])
    return Study(
        title=TITLE,
        question=QUESTION,
        runs=lambda quick: [],
        findings=findings,
        figures={
            "profiles": lambda results: summary.draw_profiles(results.computed[NAME]),
            "worlds": lambda results: summary.draw_worlds(results.computed[NAME]),
        },
        tables=tables,
        values=lambda results: {**_values(results), "findings": list(findings)},
    )
