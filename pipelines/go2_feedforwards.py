"""A Go2 with the joints of a real one: models at their best against learners, with equal data for each feedforward.

``python -m pipelines.go2_feedforwards`` needs the extra ``robots``.
"""

from cmacexp.study import Declared, declare
from pipelines.robot_walks import ALONE, ENDS, FORCE, LAST, POSITION, SPREAD, WALKS

WALK: Declared = {"scenario": "robot", "machine": "go2", "plant/as_built": "go2", **SPREAD, **LAST}
LAGGING: Declared = {**WALK, "actuator": "go2"}
GAITS: dict[str, Declared] = {
    "crawl": {"cycles": 50}, "trot": {"gait": "trot", "gait.speed": 0.4, "cycles": 100},
}  # fmt: skip
NOMINAL, IDENTIFIED, ILC, RBF, CMAC = "nominal model, advanced", "identified, advanced", "ILC", "RBF", "CMAC"
EARLIER: Declared = {"feedforward.advance": "auto"}
KINDS: dict[str, Declared] = {
    "feedback only": {"feedforward": "none"},
    "nominal model": {"feedforward": "inverse_dynamics"},
    NOMINAL: {"feedforward": "inverse_dynamics", **EARLIER},
    "identified": {"feedforward": "identified"},
    IDENTIFIED: {"feedforward": "identified", **EARLIER},
    ILC: {"feedforward": "ilc", "learning.rate": 0.6, "feedforward.cutoff": 40},
    RBF: {"feedforward": "rbf", "learning.rate": 0.025},
    CMAC: {"feedforward": "cmac", "learning.rate": 0.025},
    "CMAC, default rate": {"feedforward": "cmac"},
}
CONDITIONS: dict[str, Declared] = {
    "onboard sensors": {"sensors": "proprioceptive"},
    "ground twice as stiff": {"terrain.step_time": 0, "terrain.step_factor": 2},
    "ground half as stiff": {"terrain.step_time": 0, "terrain.step_factor": 0.5},
}
PERIODS = {"2 ms, by rule": {}, "1 ms, as with the lag": {"sampling_period": 0.001}}
AS_PLANNED = "as planned"
SEEDS = {"seed": [*range(8)]}
SHOWN = [{**POSITION, "limit": "any mm"}, {**FORCE, "limit": "any N"}]


def end_as(of: Declared, each: Declared) -> list[Declared]:
    """Return criteria of walks: how many complete, and their transfer and force errors, which are only shown."""
    return [{**entries, "of": of, "each": each} for entries in ({**WALKS, "limit": "at least 60 %"}, *SHOWN)]


def compare_to(other: str, *kinds: str) -> Declared:
    """Return the criterion that feedforwards leave a smaller transfer error than another one, in a gait."""
    return {
        **POSITION, "quantity": f"transfer error over that with {other}", "over": {"kind": other},
        "of": {"gait": "{gait}", "condition": AS_PLANNED, "kind": kinds[0]}, "each": {"kind": [*kinds]},
        "limit": "at most 100 %",
    }  # fmt: skip


STUDY = declare(
    title="Models at their best",
    question="How much of what a learner gains on a Go2 with the joints of a real one does a model gain whose torque "
    "is played earlier by the lag, with as many cycles of data, perfect and onboard sensors, and wrong ground?",
    common={"quick": {"cycles": 2}},
    runs=[
        {"set": {**LAGGING, **gait}, "labels": {"gait": name, "condition": AS_PLANNED, "period": "by rule"},
         "over": {"kind": KINDS, **SEEDS}}
        for name, gait in GAITS.items()
    ] + [
        {"set": {**LAGGING, **GAITS["trot"]}, "labels": {"gait": "trot", "period": "by rule"},
         "over": {"condition": CONDITIONS, "kind": {kind: KINDS[kind] for kind in (IDENTIFIED, CMAC)}, **SEEDS}},
    ] + [
        {"set": WALK, "labels": {"gait": "crawl", "condition": "no lag"},
         "over": {"period": PERIODS, "kind": {"feedback only": ALONE}, **SEEDS}},
    ],
    findings={
        "walks_{gait}": {
            "for": {"gait": [*GAITS]}, "says": "The Go2 completes every {gait} with each feedforward",
            "criteria": end_as({"gait": "{gait}", "condition": AS_PLANNED}, {"kind": [*KINDS]}),
        },
        "conditions": {
            "says": "The Go2 completes every trot with onboard sensors, and on ground whose stiffness is off by 2",
            "criteria": end_as({"gait": "trot"}, {"condition": [*CONDITIONS], "kind": [IDENTIFIED, CMAC]}),
        },
        "advance_{gait}": {
            "for": {"gait": [*GAITS]},
            "says": "In a {gait} a model whose torque is played earlier by the lag leaves a smaller transfer error",
            "criteria": [compare_to("nominal model", NOMINAL), compare_to("identified", IDENTIFIED)],
        },
        "learners_{gait}": {
            "for": {"gait": [*GAITS]},
            "says": "In a {gait} every learner leaves a smaller transfer error than the identified model",
            "criteria": [compare_to(IDENTIFIED, ILC, RBF, CMAC, "CMAC, default rate")],
        },
        "rivals_{gait}": {
            "for": {"gait": [*GAITS]}, "says": "In a {gait} the CMAC leaves a smaller transfer error than its rivals",
            "criteria": [compare_to(ILC, CMAC), compare_to(RBF, CMAC)],
        },
        "at_once": {
            "says": "Without the lag the Go2 crawls on elastic ground with feedback only",
            "criteria": end_as({"condition": "no lag"}, {"period": [*PERIODS]}),
        },
    },
    tables={
        name: {"rows": rows, "of": of, "columns": ENDS}
        for name, rows, of in (
            ("walks", {"gait": "gait", "kind": "feedforward"}, {"condition": AS_PLANNED}),
            ("conditions", {"condition": "condition", "kind": "feedforward"}, {"condition": [*CONDITIONS]}),
            ("at_once", {"period": "sampling period"}, {"condition": "no lag"}),
        )
    },
)  # fmt: skip
