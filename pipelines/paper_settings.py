"""Which settings reproduce Lin & Song 1997: a joint search over what the paper leaves open.

``python -m pipelines.paper_settings`` measures 20,000 settings of one leg, 2,000 of the quadruped and 400 of the
point mass, tests every claim in each of them, and predicts the claims that were kept apart with the setting it found.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.planning import Recall
from cmacexp.study import (
    ANY,
    Array,
    Claim,
    Criterion,
    DataFrame,
    Declared,
    Figure,
    Panel,
    Results,
    Series,
    declare,
    draw,
)
from pipelines import paper_claims
from pipelines.paper_measures import measure_ramp, measure_walk_apart
from pipelines.paper_search import (
    FIXED,
    FOUND,
    GRAVITY,
    LEG_RANGES,
    MACHINES,
    draw_settings,
    list_neighbours,
    list_overrides,
    read_plainly,
    search,
    search_near,
)

PRINTED, JOINT = "as printed", "joint setting"
CLAIMS = {
    "leg": {**paper_claims.LEG, **paper_claims.LEG_APART},
    "walk": {**paper_claims.WALK, **paper_claims.WALK_APART},
    "mass": paper_claims.MASS,
}
NAMES = {"leg": "one leg", "walk": "quadruped", "mass": "point mass"}
MOST_CHANGES = 3
"""Largest number of values in which a setting near the plain reading differs from it."""
QUICK = 100
"""Divisor of the number of settings in a quick run, which has one seed."""
SEEDS = 20
"""Seeds of the hash with which the setting that was found is tested."""


def compute_search(results: Results, machine: str) -> DataFrame:
    """Measure random joint settings of a machine; the first row is the plain reading."""
    count = MACHINES[machine].settings // (QUICK if results.has_one_seed else 1)
    return search(machine, draw_settings(MACHINES[machine].ranges, count))


def compute_neighbours(results: Results) -> DataFrame:
    """Measure the settings of one leg that differ from the plain reading in at most three values.

    The claims that are kept apart are tested where all others are true: ``apart:NAME``, elsewhere null.
    """
    table = search_near(1 if results.has_one_seed else MOST_CHANGES)
    plain = pd.Series(read_plainly(LEG_RANGES))
    true = table[_count_claims(table) == len(paper_claims.LEG)]
    apart = {
        row: {**values, **measure_ramp([*FIXED, *list_overrides({key: values[key] for key in plain.index})])}
        for row, values in true.to_dict("index").items()
    }
    return table.assign(
        changes=(table[plain.index] != plain).sum(axis=1),
        **{
            f"apart:{name}": pd.Series({row: claim.holds(values) for row, values in apart.items()}, dtype="boolean")
            for name, claim in paper_claims.LEG_APART.items()
        },
    )


APART = {"leg": measure_ramp, "walk": measure_walk_apart}
"""Functions that measure what only the claims need that are kept apart from the search."""


def compute_validation(results: Results) -> DataFrame:
    """Measure the plain reading and the setting that was found of each machine, with seeds of a hashed memory."""
    rows = []
    for name in CLAIMS:
        plain = read_plainly(MACHINES[name].ranges)
        seeds = SEEDS if name in APART and not results.has_one_seed else 1  # the point mass has no network
        for setting, seed in itertools.product((PRINTED, JOINT), range(seeds)):
            chosen = {**plain, **FOUND[name]} if setting == JOINT else plain
            overrides = [*list_overrides(chosen), f"seed={seed}"]
            values = MACHINES[name].measure(overrides, Recall())
            apart = APART[name](overrides) if name in APART else {}
            rows.append({"machine": name, "setting": setting, "seed": seed, **values, **apart})
    return pd.DataFrame(rows)


def _list_measured(results: Results, machine: str, setting: str) -> list[dict[str, float]]:
    """List the measured quantities of a setting, a mapping for each seed."""
    table = results.computed["validation"]
    return table[(table["machine"] == machine) & (table["setting"] == setting)].to_dict("records")


def _measure(results: Results, criterion: paper_claims.Criterion, machine: str, setting: str) -> Array:
    """Return a quantity for each seed of a setting, (seeds,); infinite where it is undefined."""
    values = [criterion.measure(row) for row in _list_measured(results, machine, setting)]
    return np.nan_to_num(values, nan=np.inf)


def _count(results: Results, machine: str, name: str) -> Array:
    """Return for each joint setting of the search if a claim is true in it, (settings,)."""
    return results.computed[machine][f"holds:{name}"].to_numpy()


def _make_claim(machine: str, name: str, claim: paper_claims.Claim) -> Claim:
    """Make a claim that is judged as printed and in the joint setting, with its share of all settings beside it."""
    criteria = [
        Criterion(
            criterion.quantity,
            partial(_measure, criterion=criterion, machine=machine, setting=setting),
            criterion.limit,
            unit=criterion.unit,
            case=setting,
            infinite="the run ended early, or nothing to compare with",
        )
        for criterion in claim.criteria
        for setting in (PRINTED, JOINT)
    ]
    if name in MACHINES[machine].claims:
        share = partial(_count, machine=machine, name=name)
        criteria.append(Criterion("settings in which it is true", share, ANY, unit="%", scale=100.0))
    return Claim(claim.words, claim.where, criteria)


def _count_claims(table: DataFrame) -> Array:
    """Return the number of claims that are true in each setting, (settings,)."""
    return table[[name for name in table if name.startswith("holds:")]].sum(axis=1).to_numpy()


def tabulate_claims(results: Results, machine: str) -> DataFrame:
    """Tabulate for each claim its verdicts, its share of the settings, and the value that matters most for it."""
    rows = []
    for name, claim in CLAIMS[machine].items():
        row: Declared = {"claim": claim.words, "where": claim.where}
        for setting in (PRINTED, JOINT):
            row[setting] = _share([claim.holds(values) for values in _list_measured(results, machine, setting)])
        if name in MACHINES[machine].claims:
            row["settings"] = _share(_count(results, machine, name))
            row["decided most by"] = _find_cause(results.computed[machine], name, list(MACHINES[machine].ranges))
        rows.append(row)
    return pd.DataFrame(rows).fillna("kept apart")


def _share(true: Sequence[bool] | Array) -> str:
    return f"{sum(true)} of {len(true)}"


def _find_cause(table: DataFrame, name: str, keys: Sequence[str]) -> str:
    """Return the open value over which the share of settings with a true claim varies most, with both ends."""
    shares = {key: table.groupby(key)[f"holds:{name}"].mean() for key in keys}
    key = max(shares, key=lambda other: float(np.ptp(shares[other])))
    low, high = shares[key].idxmin(), shares[key].idxmax()
    return f"{key.split('.')[-1]}: {high} {100 * shares[key].max():.0f} %, {low} {100 * shares[key].min():.0f} %"


def tabulate_forms(results: Results) -> DataFrame:
    """Tabulate the forms of G by the number of settings in which all claims on one leg are true, best first."""
    table = results.computed["leg"]
    most = len(paper_claims.LEG)
    counts = _count_claims(table)
    grouped = table.assign(all=counts == most, most=counts, feedback=_give_figure_12(table)).groupby(GRAVITY)
    rows = grouped.agg(
        settings=("all", "size"), feedback=("feedback", "sum"), all=("all", "sum"), most=("most", "max")
    )
    titles = {
        GRAVITY: "factors of G",
        "feedback": "1.1 N, then 0.9 N",
        "all": "all claims",
        "most": f"most claims of {most}",
    }
    return rows.sort_values(["all", "feedback"], ascending=False).reset_index().rename(columns=titles).head(12)


def _give_figure_12(table: DataFrame) -> Any:
    """Return for each setting if feedback only gives 1.1 N, then 0.9 N, (settings,)."""
    return table["holds:peak"] & table["holds:settles"]


def _find_simplest(results: Results) -> DataFrame:
    """Return the settings near the plain reading in which all claims on one leg are true, those of fewest changes."""
    table = results.computed["neighbours"]
    true = table[_count_claims(table) == len(paper_claims.LEG)]
    return true[true["changes"] == true["changes"].min()]


def list_simplest(results: Results) -> DataFrame:
    """List the simplest settings: what differs from the plain reading, the numbers of Fig. 12, errors left."""
    plain = read_plainly(LEG_RANGES)
    rows = [
        {
            "differs from the plain reading": ", ".join(
                f"{key}={row[key]}" for key in plain if row[key] != plain[key]
            ),
            **{title: row[name] for title, (name, _) in FIGURE_12.items()},
            "left in x, %": 100.0 * row["transfer_x_5"] / row["transfer_x_1"],
            "left in y, %": 100.0 * row["transfer_y_5"] / row["transfer_y_1"],
        }
        for row in _find_simplest(results).to_dict("records")
    ]
    return pd.DataFrame(sorted(rows, key=lambda row: row["left in y, %"]))


def tabulate_apart(results: Results) -> DataFrame:
    """Tabulate in how many of the simplest settings the claims are true that are kept apart from the search."""
    simplest = _find_simplest(results)
    return pd.DataFrame(
        {
            "claim": claim.words,
            "where": claim.where,
            "true in": _share(simplest[f"apart:{name}"]),
        }
        for name, claim in paper_claims.LEG_APART.items()
    )


FIGURE_12 = {
    "largest force, cycle 1, N": ("force_peak_1", "1.1"),
    "settled, cycle 1, N": ("force_settled_1", "about 0.9"),
    "settled, cycle 2, N": ("force_settled_2", "less than 5 % off 1"),
    "settled, cycle 5, N": ("force_settled_5", "further off than in cycle 2"),
}
"""Numbers of Fig. 12 by their title: name of the quantity, and what the text of the paper says of it."""


def tabulate_figure_12(results: Results) -> DataFrame:
    """Tabulate the numbers of Fig. 12: the paper's text, the plain reading and the joint setting, with its seeds."""

    def read(setting: str, name: str) -> str:
        values = [row[name] for row in _list_measured(results, "leg", setting)]
        least, most = f"{min(values):.3f}", f"{max(values):.3f}"
        return least if least == most else f"{least} to {most}"

    return pd.DataFrame(
        {"quantity": title, "the paper": words, **{setting: read(setting, name) for setting in (PRINTED, JOINT)}}
        for title, (name, words) in FIGURE_12.items()
    )


def draw_figure_12(results: Results) -> Figure:
    """Draw Fig. 12: the force of cycles 1, 2 and 5, of the plain reading and of the joint setting."""
    panels = []
    for setting in (PRINTED, JOINT):
        run = results.select(setting=setting).run
        rows = run.trace[run.trace["cycle"].isin((1, 2, 5))]
        force = rows["force"].to_numpy()
        points = np.arange(len(force))
        desired = rows["force_desired"].to_numpy()
        lines = [Series("contact force", points, force), Series("desired", points, desired)]
        thirds = [len(force) // 3, 2 * len(force) // 3]
        panels.append(Panel(setting, "data point", "force, N", lines, x_limits=thirds, y_limits=[0.9, 1.1]))
    return draw(panels, height=3.0)


def values(results: Results) -> Declared:
    """Return the numbers of settings, and those in which all claims on one leg are true."""
    counts = {name: _count_claims(results.computed[name]) for name in CLAIMS}
    claims = {name: len(MACHINES[name].claims) for name in CLAIMS}
    return {
        "counts": {name: len(count) for name, count in counts.items()},
        "claims": claims,
        "feasible": {name: int((counts[name] == claims[name]).sum()) for name in CLAIMS},
        "most": {name: int(count.max()) for name, count in counts.items()},
        "near": sum(1 for _ in list_neighbours(LEG_RANGES, MOST_CHANGES)),
        "simplest": len(_find_simplest(results)),
    }


def _with_form(results: Results, form: str) -> Array:
    """Return for each setting with a form of G if feedback only gives 1.1 N, then 0.9 N, (settings,)."""
    table = results.computed["leg"]
    return _give_figure_12(table)[table[GRAVITY] == form].to_numpy()


def _in_leg(results: Results, name: str, cycle: int) -> Array:
    """Return a quantity of the joint setting of one leg in a cycle, for each seed."""
    return results.select(setting=JOINT).at(cycle, name)


RUNS: Mapping[str, Sequence[str]] = {PRINTED: ["scenario=one_leg"], JOINT: ["scenario=paper_leg"]}
STUDY = replace(
    declare(
        title="Which settings reproduce the paper",
        question="Which values of what Lin & Song 1997 leave open make its claims true, all at once?",
        runs=[{"set": ["cycles=5"], "over": {"setting": RUNS}, "seeds": True}],
        computed={
            **{name: partial(compute_search, machine=name) for name in CLAIMS},
            "neighbours": compute_neighbours, "validation": compute_validation,
        },
        findings={
            "printed_form": {
                "says": "With G as printed feedback only gives 1.1 N, then 0.9 N in almost no setting",
                "quantity": "settings with G as printed in which it does",
                "value": partial(_with_form, form="[1,1,1,1]"), "limit": "at most 5 %",
            },
            "simplest": {
                "says": "Settings that differ from the plain reading in three values make all claims on one leg "
                "true; with two none does",
                "quantity": "least number of values that differ",
                "value": lambda results: np.nan_to_num([_find_simplest(results)["changes"].min()], nan=np.inf),
                "infinite": "no setting makes all true", "limit": "3 to 3",
            },
            "figure_12": {
                "says": "`scenario=paper_leg` gives the printed numbers of Fig. 12",
                "criteria": [
                    {"quantity": "largest force, cycle 1",
                     "value": lambda results: 1.0 + _in_leg(results, "force_overshoot", 1),
                     "limit": "1.05 to 1.15 N"},
                    {"quantity": "settled force, cycle 1",
                     "value": partial(_in_leg, name="force_settled", cycle=1), "limit": "0.85 to 0.95 N"},
                    {"quantity": "size of the steady-state error, cycle 2",
                     "value": lambda results: abs(_in_leg(results, "force_steady_state_error", 2)),
                     "limit": "at most 5 %"},
                    {"quantity": "steady-state error, cycle 5 over cycle 2",
                     "value": lambda results: abs(
                         _in_leg(results, "force_steady_state_error", 5)
                         / _in_leg(results, "force_steady_state_error", 2)
                     ), "limit": "at least 1"},
                ],
            },
        },
        figures={"figure_12": draw_figure_12},
        tables={
            **{f"{name}_claims": partial(tabulate_claims, machine=name) for name in CLAIMS},
            "apart": tabulate_apart, "forms": tabulate_forms,
            "simplest": list_simplest, "figure_12": tabulate_figure_12,
        },
        values=values,
    ),
    claims={
        f"{machine}_{name}": _make_claim(machine, name, claim)
        for machine, claims in CLAIMS.items()
        for name, claim in claims.items()
    },
)  # fmt: skip
