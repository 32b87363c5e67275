"""Alternatives to the CMAC: models, radial basis functions, a perceptron, iterative learning.

``python -m pipelines.feedforwards`` lets each of them learn the same steps of one leg and the same walk under the
paper's ideal conditions, where its claims are judged, and in randomised runs, called worlds. It takes some minutes,
mostly for the perceptron. The benchmark tunes the learners, and measures their memory and time.
"""

from functools import partial

import numpy as np

from cmacexp.study import (
    TRANSFER,
    Array,
    Declared,
    Results,
    Sample,
    completed,
    declare,
    of_completed,
    quotients,
)
from pipelines.common_results import cycles_to
from pipelines.worlds import TESTED, draw_worlds

ON_KNOWN_MASSES = ["feedforward=inverse_dynamics"]
KINDS = {
    "feedback only": ["feedforward=none"],
    "exact model": ON_KNOWN_MASSES,
    "masses 20 % too light": [*ON_KNOWN_MASSES, "feedforward.mass_factor=0.8"],
    "masses 20 % too heavy": [*ON_KNOWN_MASSES, "feedforward.mass_factor=1.2"],
    "model": ON_KNOWN_MASSES,
    "CMAC": ["feedforward=cmac"],
    "CMAC of angles": ["feedforward=cmac", "cmac.inputs=[angle]"],
    "CMAC on model": ["feedforward=cmac_on_model"],
    "RBF": ["feedforward=rbf"],
    "MLP": ["feedforward._target_=pipelines.perceptron.Perceptron"],
    "ILC": ["feedforward=ilc"],
}
"""Overrides of each feedforward; in worlds the model has the planner's masses, not the true ones."""
ALONE = ["feedback only"]
UNSEEDED = [*ALONE, "exact model", "masses 20 % too light", "masses 20 % too heavy", "RBF", "ILC"]
SEEDED = ["CMAC", "CMAC of angles", "MLP"]
"""Feedforwards that depend on the seed of a hash or of initial weights."""
KEPT = ["CMAC", "CMAC on model", "RBF"]
"""Learners whose weights are carried over."""
LEARNERS = [*KEPT, "MLP", "ILC"]
LEG, WALK = "one leg", "quadruped"
CHANGES: dict[str, tuple[float, list[str]]] = {
    "stroke 150 mm": (1.0, ["gait.stroke=0.15"]),
    "stroke 250 mm": (1.0, ["gait.stroke=0.25"]),
    "ground stiffer, known": (1.5, ["terrain.assumed_stiffness=15"]),
    "ground stiffer, unknown": (1.5, []),
}
"""Changes of path and ground after the first runs: factor of the ground stiffness; overrides."""
WEIGHTS, AT_ONCE = "record.weights=true", "learning.start_cycle=1"


def _learn(scenario: str, cycles: int, group: str, kinds: list[str], *more: str, **keys: object) -> Declared:
    """Return runs under the paper's conditions; feedforwards that depend on a seed run with every seed.

    ``keys`` adds or replaces keys of the declaration.
    """
    return {
        "set": [
            *("reference=literal", "learning.lead=0", "record.cycles=[1]"),
            *(f"scenario={scenario}", f"cycles={cycles}"),
            *more,
        ],
        "over": {"kind": {kind: KINDS[kind] for kind in kinds}},
        "seeds": kinds[0] in SEEDED,
        "labels": {"group": group},
        "quick": {"cycles": 6},
        **keys,
    }


def _in_worlds(
    group: str,
    kinds: list[str],
    *words: str,
    scenario: str = "one_leg",
    stiffer: float = 1.0,
    labels: dict[str, str] | None = None,
    **keys: object,
) -> Declared:
    """Return runs in worlds, unguarded unless the overrides ``words`` switch the guard on.

    ``stiffer`` multiplies the ground stiffness; ``keys`` adds or replaces keys of the declaration.
    """
    common = {"one_leg": ["reference=aware", "learning=lasting"]}.get(scenario, [])
    return {
        "set": [f"scenario={scenario}", *common, "learning.guard=none", "cycles=20", "record.cycles=[1]"],
        "quick": {"cycles": 5},
        "over": {
            "world": draw_worlds(scenario, TESTED, stiffer),
            "kind": {kind: [*words, *KINDS[kind]] for kind in kinds},
        },
        "labels": {"group": group, **(labels or {})},
        **keys,
    }


IN_LEG, IN_WALK, SMOOTH, GUARDED = "worlds, one leg", "worlds, quadruped", "worlds, without jumps", "worlds, guarded"
AFTER: list[tuple[list[str], list[str], Declared]] = [
    (ALONE, [], {"labels": {"start": "from nothing"}}),
    (KEPT, [AT_ONCE], {"labels": {"start": "from nothing"}}),
    (KEPT, [AT_ONCE], {"labels": {"start": "carried over"}, "after": {"group": IN_LEG}}),
]
"""Feedforwards, overrides and further keys of the runs after a change."""


def count_cycles(results: Results, small: float) -> Array:
    """Count cycles until the transfer error stays at most ``small``, m; infinite if it never does, (runs,)."""
    cycles = results.value("cycles")
    histories = [row.history(TRANSFER) for row in results.rows]
    return cycles_to(np.array([np.append(h, np.full(cycles - len(h), np.inf)) for h in histories]), small)


def cycles_over(results: Results, kind: str, rivals: list[str]) -> Array:
    """Return the cycles to a tenth of the error of feedback only, relative to the fastest rival, (seeds,).

    The fastest rival is the one with the smallest mean over seeds, which is the reference.
    """
    small = 0.1 * float(results.select(kind="feedback only").measure(TRANSFER)[0])
    fastest = min(float(count_cycles(results.select(kind=other), small).mean()) for other in rivals)
    return quotients(count_cycles(results.select(kind=kind), small), fastest)


def _error_in(cycle: int, scale: float = 1.0) -> Sample:
    return lambda runs: scale * runs.at(cycle, TRANSFER)


def _tabulate_learning(group: str, cycles: list[int], title: str, value: Sample) -> Declared:
    """Return the table of errors of every feedforward, with a further quantity of the last cycle."""
    return {
        "rows": {"kind": "feedforward"},
        "columns": of_completed(
            {f"cycle {n}, mm": _error_in(n, 1e3) for n in cycles}
            | {"force RMS at the end, N": lambda runs: runs.end("force_rmse"), title: value}
        )
        | {"completed": completed},
        "of": {"group": group},
    }


MANY: Declared = {
    "rows": {"kind": "feedforward"},
    "columns": of_completed({f"cycle {cycle}, mm": _error_in(cycle, 1e3) for cycle in (5, 20)})
    | {"completed": completed},
}
LATE = _error_in(20)
TENTH = "cycles to a tenth of the error of feedback only"
FIRST = "error of {} in its first cycle with a new stroke, over that "
CASES = {IN_LEG: LEG, IN_WALK: WALK}
CARRIED, FROM_NOTHING = {"start": "carried over"}, {"start": "from nothing"}


def _over(kind: str, other: str, cycle: int, limit: float, groups: tuple[str, ...] = tuple(CASES)) -> list[Declared]:
    """Return criteria of the error of one feedforward in a cycle relative to that of another, by group."""
    return [
        {"quantity": f"error in cycle {cycle}: {kind} over {other}", "value": _error_in(cycle),
         "of": {"group": group, "kind": kind}, "over": {"kind": other}, "case": CASES[group],
         "limit": f"at most {limit}"}
        for group in groups
    ]  # fmt: skip


def _after(changes: list[str], kind: str, over: dict[str, str], **criterion: object) -> Declared:
    """Complete a criterion on runs after changes that start with the weights from before them."""
    return {**criterion, "of": {"kind": kind, **CARRIED}, "over": over, "each": {"group": changes}}


STROKES = list(CHANGES)[:2]
STUDY = declare(
    title="Alternatives to the CMAC",
    question="How do models, CMAC, radial basis functions, a perceptron and iterative learning control compare in "
             "accuracy and speed of learning, and how much of what they learn is of use after a change?",
    runs=[
        _learn("one_leg", 100, LEG, UNSEEDED),
        _learn("one_leg", 100, LEG, SEEDED, WEIGHTS),
        _learn("quadruped", 40, WALK, UNSEEDED),
        _learn("quadruped", 40, WALK, SEEDED),
        *(
            declared
            for name, stroke in (("another stroke: 150 mm", "gait.stroke=0.15"),
                                 ("another stroke: 250 mm", "gait.stroke=0.25"))
            for declared in (
                _learn("one_leg", 3, name, ALONE, stroke, quick={}),
                _learn("one_leg", 3, name, ["CMAC"], AT_ONCE, stroke, quick={}, after={"group": LEG}),
            )
        ),
        _in_worlds(IN_LEG, KEPT, WEIGHTS),
        _in_worlds(IN_LEG, [*ALONE, "model", "MLP", "ILC"]),
        _in_worlds(IN_WALK, [*ALONE, "model", *LEARNERS], scenario="quadruped_lasting"),
        _in_worlds(SMOOTH, ["model", "CMAC"], "gait.vertical=two_cubics"),
        _in_worlds(GUARDED, LEARNERS, "learning.guard=freeze"),
        *(
            _in_worlds(change, kinds, *words, *more, stiffer=stiffer, **keys)
            for change, (stiffer, words) in CHANGES.items()
            for kinds, more, keys in AFTER
        ),
    ],
    measures={"ended_by_guard": lambda run: bool(run.manifest["guard"])},
    claims={
        "rapid": {
            "words": "CMAC is suited to real-time control by its simple design and rapid learning",
            "where": "section 1",
            "quantity": f"{TENTH}, CMAC over the fastest of RBF, MLP, ILC",
            "value": partial(cycles_over, kind="CMAC", rivals=["RBF", "MLP", "ILC"]), "each": {"group": [LEG, WALK]},
            "limit": "at most 1.25", "opposite": "at least 2",
        },
        "generalises": {
            "words": "CMAC generalises: it generates similar outputs for similar inputs",
            "where": "section 1",
            "criteria": [
                {"quantity": FIRST.format("CMAC") + "with feedback only", "value": _error_in(1),
                 "of": {"group": f"another {stroke}", "kind": "CMAC"}, "over": {"kind": "feedback only"},
                 "case": stroke, "limit": "at most 25 %", "opposite": "at least 100 %"}
                for stroke in ("stroke: 150 mm", "stroke: 250 mm")
            ],
        },
    },
    findings={
        "models": {
            "says": "In randomised runs, the error of CMAC in cycle 20 is far below that of inverse dynamics with "
            "the planned masses",
            "criteria": _over("CMAC", "model", 20, 0.5),
        },
        "on_model": {
            "says": "In randomised runs, a CMAC on a model with the planned masses starts better than a CMAC without "
            "a model and ends as well",
            "criteria": [*_over("CMAC on model", "CMAC", 5, 0.8), *_over("CMAC on model", "CMAC", 20, 1.25)],
        },
        **{
            f"learners_{case}": {
                "says": f"In randomised runs, at rate `auto` and unguarded, CMAC ({case}) is more accurate in cycle "
                "20 than RBF, MLP and ILC",
                "criteria": [
                    criterion
                    for other in ("RBF", "MLP", "ILC")
                    for criterion in _over("CMAC", other, 20, 1.0, (group,))
                ],
            }
            for group, case in CASES.items()
        },
        "jumps": {
            "says": "In randomised runs, inverse dynamics with the planned masses and CMAC are both far more "
            "accurate on a path without jumps: plan such paths first",
            "quantity": "error in cycle 20 without jumps of the planned speed, over that with them", "value": LATE,
            "of": {"group": SMOOTH}, "over": {"group": IN_LEG}, "each": {"kind": ["model", "CMAC"]},
            "limit": "at most 0.5",
        },
        "guard": {
            "says": "In randomised runs, the guard lets each of these learners learn at rate `auto`",
            "quantity": "worlds in which the guard lets learning go on",
            "value": lambda runs: runs.measure("ended_by_guard") <= 0,
            "of": {"group": GUARDED}, "each": {"kind": LEARNERS}, "limit": "at least 75 %",
        },
        "keep": {
            "says": "In randomised runs, a CMAC that keeps its weights after a change of stroke or ground has a "
            "smaller error over the first 5 cycles than one that starts from nothing: keep them",
            **_after(
                list(CHANGES), "CMAC", FROM_NOTHING, limit="at most 1",
                quantity="mean error of the first 5 cycles: CMAC with its weights over CMAC from nothing",
                value=lambda runs: sum(runs.at(cycle, TRANSFER) for cycle in range(1, 6)),
            ),
        },
        "keep_late": {
            "says": "Kept weights do no harm later: in cycle 20 CMAC is about as accurate as from nothing, or more "
            "accurate",
            **_after(
                list(CHANGES), "CMAC", FROM_NOTHING, limit="at most 1.25", value=LATE,
                quantity="error in cycle 20: CMAC with its weights over CMAC from nothing",
            ),
        },
        "carries_most": {
            "says": "In randomised runs, RBF carries most of what it has learnt over to another stroke",
            **_after(
                STROKES, "RBF", {"kind": "feedback only", **FROM_NOTHING}, limit="at most 25 %", value=_error_in(1),
                quantity=FIRST.format("RBF") + "with feedback only",
            ),
        },
        "carries_more": {
            "says": "In randomised runs, RBF carries more over to another stroke than CMAC",
            **_after(
                STROKES, "RBF", {"kind": "CMAC"}, limit="at most 0.8", value=_error_in(1),
                quantity=FIRST.format("RBF") + "of CMAC",
            ),
        },
    },
    figures={
        "leg": {"metric": TRANSFER, "by": "kind", "of": {"group": LEG}, "log": "xy"},
        "walk": {"metric": TRANSFER, "by": "kind", "of": {"group": WALK}, "log": "xy"},
        "changes": [
            {"metric": TRANSFER, "by": "kind", "of": {"group": change, **start}, "log": "y",
             "title": f"{change}, {start['start']}"}
            for change in CHANGES
            for start in (CARRIED, FROM_NOTHING)
        ],
    },
    tables={
        "leg": _tabulate_learning(
            LEG, [2, 3, 5, 10, 20, 50], "settled force error at the end, %",
            lambda runs: 100 * runs.end("force_steady_state_error"),
        ),
        "walk": _tabulate_learning(
            WALK, [2, 3, 5, 10, 20], "largest tilt at the end, mrad", lambda runs: 1e3 * runs.end("tilt_max")
        ),
        "leg_worlds": {**MANY, "of": {"group": IN_LEG}},
        "walk_worlds": {**MANY, "of": {"group": IN_WALK}},
        "guarded": {
            **MANY, "of": {"group": GUARDED},
            "columns": {**MANY["columns"],
            "ended by the guard": lambda runs: f"{runs.measure('ended_by_guard').sum():.0f} of {len(runs)}"},
        },
    },
)  # fmt: skip
