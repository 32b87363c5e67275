"""Robots in gaits without static equilibrium, with unknown loads, and one that differs from its model.

``python -m pipelines.moving_robots`` needs the extra ``robots``.
"""

from functools import partial
from typing import Any

import numpy as np

from cmacexp.study import Declared, Results, Run, declare, of_completed
from pipelines.common_results import if_completed
from pipelines.robot_walks import (
    ALONE,
    ENDS,
    FORCE_LEFT,
    GROUNDS,
    MODEL,
    ON_BOTH,
    POSITION,
    POSITION_LEFT,
    SPREAD,
    WALK,
    WALKS,
    learn,
)


def _last_body(run: Run) -> Any:
    """Read the body's trace of the last cycle."""
    return run.read_trace([run.config["cycles"]]).body


@if_completed
def off_course(run: Run) -> float:
    """Return the relative error of the distance that the body travels in the last cycle."""
    gait = run.config["gait"]
    body = _last_body(run)
    speed = gait["stroke"] / (gait["duty_factor"] * gait["cycle_time"])
    planned = speed * run.config["sampling_period"] * (body.steps - 1)
    return float(abs((body["cog_x"][-1] - body["cog_x"][0]) / planned - 1.0))


@if_completed
def drift(run: Run) -> float:
    """Return the largest lateral distance of the body from its course in the last cycle, m."""
    return float(np.abs(_last_body(run)["cog_y"]).max())


BOTH: Declared = {"feedback only": ALONE, "CMAC": learn(50)}
LASTING: Declared = {"feedback only": ALONE, "CMAC": learn(300)}
"""Kinds of feedforward in walks of 300 cycles."""
GAITS: list[tuple[Declared, Declared]] = [
    (BOTH, {"wave 0.075 m/s": {"gait": "wave"}, "walk 0.2 m/s": {"gait": "walk", "gait.speed": 0.2}}),
    (LASTING, {"trot 0.4 m/s": {"gait": "trot", "gait.speed": 0.4}}),
    (BOTH, {"trot 0.8 m/s": {"gait": "trot", "gait.speed": 0.8},
            "amble 0.4 m/s": {"gait": "amble", "gait.speed": 0.4},
            "pace 0.4 m/s": {"gait": "pace", "gait.speed": 0.4}}),
]  # fmt: skip
BUILT: Declared = {"machine": "go2", "plant/as_built": "go2_dim", "plant.friction": 0.786}
PUSH, LAG = "trot, push of 90 N", "Go2 as built, lag"
WORLDS: list[tuple[Declared, Declared]] = [
    (BOTH, {"as modelled": {"machine": "go1"}, "payload of 20 %": {"machine": "go1", "payload.weight": 25}}),
    (BOTH, {"slope of 5 %": {"machine": "go1", "terrain.slope": 0.05, "terrain.slope_start": 0.2}}),
    ({**BOTH, "nominal model": MODEL,
      "CMAC, load as modelled": {**learn(50), "force_control.load_sharing": "dynamic"}}, {"Go2 as built": BUILT}),
    (LASTING, {LAG: {**BUILT, "actuator": "go2"}, "a sample late": {"machine": "go1", "actuator.delay": 1}}),
    (BOTH, {PUSH: {"machine": "go1", "gait": "trot", "gait.speed": 0.4, "plant.push": 90, "plant.push_time": 3}}),
]  # fmt: skip
"""Kinds of feedforward, and worlds that are unknown to the planner."""
CARRIED: Declared = {
    "network": {"joint angles and velocities": {"cmac": "quadruped"}, "phase": {"cmac": "phase"}},
    "ground": GROUNDS,
    "start": {"on their paths": {}, "disturbed": SPREAD},
}
TROT: Declared = {
    "scenario": "robot", "feedforward": "cmac", "gait": "trot", "gait.cycle_time": 0.4, "plant.start_moving": True,
}  # fmt: skip
FASTER = {**TROT, "gait.speed": 0.4, "cycles": 6}
AT_04 = {"part": "gaits", "gait": "trot 0.4 m/s", "kind": "CMAC"}
END: Declared = {**POSITION, "quantity": "transfer error of the last cycle", "each": ON_BOTH}
FORCE: Declared = {**FORCE_LEFT, "each": ON_BOTH}


def _walk_in(world: Declared, kinds: Declared) -> Declared:
    """Return the runs in a world; the Go2 as built has 16 random starts, as it falls from many with feedback only."""
    grounds = {name: GROUNDS[name] for name in [*GROUNDS][: 1 if "slope of 5 %" in world else 2]}
    seeds: Declared = {"seed": list(range(16))} if "Go2 as built" in world else {}
    return {
        "over": {"world": world, "ground": grounds, **seeds, "kind": kinds}, "labels": {"part": "worlds"},
        "seeds": not seeds,
    }  # fmt: skip


def _in_world(world: str, kind: str = "CMAC") -> dict[str, str]:
    return {"part": "worlds", "world": world, "kind": kind}


STUDY = declare(
    title="Robots that move",
    question="What does learned feedforward gain in gaits that no static equilibrium holds, with unknown loads, and "
    "on a robot that differs from its model?",
    measures={"off_course": off_course, "drift": drift},
    common={"set": WALK, "quick": {"cycles": 2}, "seeds": True},
    runs=[
        *(
            {"over": {"gait": gaits, "kind": kinds, "ground": GROUNDS,
                      "sensors": {"perfect": {}, "encoders": {"sensors": "encoders"}}},
             "labels": {"part": "gaits"}}
            for kinds, gaits in GAITS
        ),
        *(_walk_in(worlds, kinds) for kinds, worlds in WORLDS),
        {"set": {**TROT, "gait.speed": 0.3, "cycles": 50, "record.weights": True, "record": "trace"},
         "over": CARRIED, "labels": {"part": "before"}},
        {"set": FASTER, "over": CARRIED, "labels": {"part": "anew"}},
        {"set": FASTER, "over": CARRIED, "labels": {"part": "carried"}, "after": {"part": "before"}},
    ],
    findings={
        "walks": {
            "says": "Every gait walks to the end, with feedback only and while a CMAC learns, with perfect sensors "
            "and encoders",
            **WALKS, "of": {"part": "gaits"}, "each": {"gait": [name for _, gaits in GAITS for name in gaits]},
            "limit": "at least 90 %",
        },
        "trot": {
            "says": "In a trot of 0.4 m/s the transfer error ends at 0.7 mm or less",
            **END, "of": {**AT_04, "sensors": "perfect"}, "limit": "at most 0.7 mm",
        },
        "course": {
            "says": "The trot of 0.4 m/s keeps its speed and its course",
            "criteria": [
                {"quantity": quantity, "value": partial(Results.measure, name=measure),
                 "of": {**AT_04, "sensors": "perfect"}, "each": ON_BOTH,
                 "limit": limit}
                for quantity, measure, limit in (
                    ("relative error of the speed", "off_course", "at most 1 %"),
                    ("largest distance from the course", "drift", "at most 100 mm"),
                )
            ],
        },
        "fast": {
            "says": "In a trot of 0.8 m/s the transfer error ends at 1.5 mm or less",
            **END, "of": {**AT_04, "gait": "trot 0.8 m/s", "sensors": "perfect"}, "limit": "at most 1.5 mm",
        },
        "trot_force": {
            "says": "Learning lowers the force error of the trot by at least a fifth",
            **FORCE, "of": {**AT_04, "sensors": "perfect"}, "limit": "at most 80 %",
        },
        "encoders": {
            "says": "With encoders, too, learning lowers the transfer error of the trot, to 2 mm or less",
            "criteria": [
                {**POSITION_LEFT, "of": {**AT_04, "sensors": "encoders"}, "each": ON_BOTH, "limit": "at most 100 %",
                 "beside": None},
                {**END, "of": {**AT_04, "sensors": "encoders"}, "limit": "at most 2 mm"},
                {**POSITION, "of": {**AT_04, "sensors": "encoders"}, "each": {**ON_BOTH, "kind": ["feedback only"]},
                 "limit": "any mm"},
            ],
        },
        "worlds": {
            "says": "In every world at least half of the walks with a CMAC complete",
            **WALKS, "of": {"part": "worlds", "kind": "CMAC"}, "limit": "at least 50 %",
            "each": {"world": [name for _, worlds in WORLDS for name in worlds]},
        },
        "late": {
            "says": "Where torques act a sample late, the transfer error ends at 1 mm or less",
            **END, "of": _in_world("a sample late"), "limit": "at most 1 mm",
        },
        "payload": {
            "says": "With an unknown payload the force error of cycle 6 is at most 1.3 times that without",
            **FORCE, "quantity": "force error of cycle 6 with the payload over that without",
            "value": lambda runs: runs.at(6, "force_rmse"), "of": _in_world("payload of 20 %"),
            "over": {"world": "as modelled"},
            "limit": "at most 130 %", "beside": "force error of cycle 6, N",
        },
        "push": {
            "says": "Of the robots that are pushed aside, with feedback only or while a CMAC learns, at least half "
            "walk on",
            **WALKS, "of": {"part": "worlds", "world": PUSH}, "each": ON_BOTH, "limit": "at least 50 %",
        },
        "slope": {
            "says": "On a slope learning lowers the force error",
            **FORCE, "of": _in_world("slope of 5 %"), "each": {"ground": ["elastic ground"]},
            "limit": "at most 100 %",
        },
        "built_walks": {
            "says": "A Go2 as built completes at least half of its walks with the CMAC",
            "criteria": [
                {**WALKS, "of": {"part": "worlds", "world": "Go2 as built"}, "each": {"kind": kinds, **ON_BOTH},
                 "limit": limit}
                for kinds, limit in ((["CMAC"], "at least 50 %"), (["feedback only", "nominal model"], "any %"))
            ],
        },
        "as_built": {
            "says": "On a Go2 as built the transfer error with the CMAC is at most 5 %, the force error at most 25 % "
            "of that with feedback only",
            "criteria": [
                {**POSITION_LEFT, "of": _in_world("Go2 as built"), "each": ON_BOTH, "limit": "at most 5 %"},
                {**FORCE, "of": _in_world("Go2 as built"), "limit": "at most 25 %"},
            ],
        },
        "by_model": {
            "says": "On a Go2 as built both errors with the nominal model are at least 20 % of those with feedback "
            "only",
            "criteria": [
                {**error, "of": _in_world("Go2 as built", "nominal model"), "each": ON_BOTH, "limit": "at least 20 %"}
                for error in (POSITION_LEFT, FORCE_LEFT)
            ],
        },
        "fixed": {
            "says": "On a Go2 as built the force error with a CMAC and the load of the model is at least half of "
            "that with feedback only",
            **FORCE, "of": _in_world("Go2 as built", "CMAC, load as modelled"), "limit": "at least 50 %",
        },
        "carries_{network}_{start}": {
            "for": {"network": [*CARRIED["network"]], "start": [*CARRIED["start"]]},
            "says": "With a network addressed by {network}, what was learnt at one speed helps at another when feet "
            "start {start}",
            **FORCE, "quantity": "transfer error of the first cycle over that of learning anew",
            "value": lambda runs: runs.at(1, "transfer_rmse"),
            "of": {"part": "carried", "network": "{network}", "start": "{start}"},
            "over": {"part": "anew"}, "limit": "at most 50 %", "beside": "transfer error of the first cycle, mm",
        },
        "lag": {
            "says": "On a Go2 as built with the lag of its drives the transfer error ends at 0.5 mm or less",
            **END, "of": _in_world(LAG), "limit": "at most 0.5 mm",
        },
    },
    tables={
        name: {
            "rows": {**{key: key for key in keys}, "kind": "feedforward"}, "of": {"part": name},
            "columns": {
                **ENDS,
                **of_completed(
                    {
                        "error of the speed, %": lambda runs: 100 * runs.measure("off_course"),
                        "off course, mm": lambda runs: 1e3 * runs.measure("drift"),
                    }
                ),
            },
        }
        for name, keys in (("gaits", ("gait", "ground", "sensors")), ("worlds", ("world", "ground")))
    },
    figures={
        "worlds": [
            {"metric": metric, "by": "kind", "log": "y",
             "of": {"part": "worlds", "world": "Go2 as built", "ground": "elastic ground"}}
            for metric in ("transfer_rmse", "force_rmse")
        ],
    },
)  # fmt: skip
