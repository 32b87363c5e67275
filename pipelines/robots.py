"""Robots of today: CMAC, models and iterative learning with gains by one rule; ablation of the method's parts.

``python -m pipelines.robots`` needs the extra ``robots``.
"""

from functools import partial

from cmacexp.study import Declared, Results, completed, compute_growth, declare, describe_estimates, of_completed
from pipelines.robot_walks import ALONE, ENDS, FORCE_LEFT, GROUNDS, MODEL, OTHERS, ROBOTS, WALK, learn

LIGHTER = dict.fromkeys(
    [f"plant.as_built.{name}" for name in ("trunk_mass_factor", "trunk_inertia_factor", "leg_mass_factor")], 0.8333
)
"""Overrides of a robot for which planner and controller assume masses that are 20 % too large."""
KINDS: dict[str, Declared] = {
    "feedback only": ALONE,
    "nominal model": MODEL,
    "feedback only, lighter robot": {**ALONE, **LIGHTER},
    "model 20 % too heavy": {**MODEL, **LIGHTER},
    "CMAC": learn(50),
    "CMAC, lighter robot": {**learn(50), **LIGHTER},
    "CMAC on that model": {**learn(50), **LIGHTER, "feedforward": "cmac_on_model"},
    "ILC": {**learn(50), "feedforward": "ilc"},
    "RBF": {**learn(50), "feedforward": "rbf"},
}
WITHOUT: dict[str, Declared] = {
    "posture rate": {"posture.rate_gain": 0},
    "load ramps": {"gait.load_ramp": 0, "gait.unload_ramp": 0},
    "time between touch-down and lift-off": {"gait.touch_down": None},
    "rate of the load": {"force_control.load_rate": False},
    "inertia in the load sharing": {"force_control.load_sharing": "static"},
    "force feedback": {"force_control.elasticity": 0, "force_control.admittance": 0},
    "ground damping": {"terrain.damping": 0},
    "LEAD compensator": {"controller.lead_alpha": 1},
}
"""Ablation: overrides that leave out one part of the method."""
GO1 = {"Go1": ROBOTS["Go1"]}
COMPLETE: Declared = {
    "quantity": "walks that complete", "value": lambda runs: runs.completed, "limit": "at least 70 %",
}  # fmt: skip
EACH = {"robot": [*ROBOTS]}
CMAC = {"part": "feedforwards", "kind": "CMAC"}
FORCE: Declared = {
    **FORCE_LEFT,
    "quantity": "force error over that of feedback only",
    "each": EACH,
    "limit": "at most 25 %",
}
FORCE_25 = partial(Results.at, cycle=25, name="force_rmse")
POSITION: Declared = {
    **FORCE, "quantity": "transfer error over that of feedback only", "of": CMAC,
    "value": lambda runs: runs.end("transfer_rmse", 1), "limit": "at most 5 %", "beside": "foot error, mm",
}  # fmt: skip
COLUMNS: Declared = {
    **ENDS,
    **of_completed(
        {
            "joint error, mrad": lambda runs: 1e3 * runs.end("joint_rmse", 1),
            "tilt, mrad": lambda runs: 1e3 * runs.end("tilt_max", 1),
            "feedforward share, %": lambda runs: 100 * runs.end("feedforward_share", 1),
        }
    ),
}


def _describe_last(results: Results) -> str | None:
    """Format transfer error, mm, and force error, N, of the last cycle."""
    return describe_estimates(
        results, lambda runs: 1e3 * runs.end("transfer_rmse", 1), lambda runs: runs.end("force_rmse", 1)
    )


def _describe_cycle(results: Results, cycle: int) -> str | None:
    """Format transfer error, mm, and force error, N, of a cycle."""
    return describe_estimates(
        results, lambda runs: 1e3 * runs.at(cycle, "transfer_rmse"), lambda runs: runs.at(cycle, "force_rmse")
    )


def _compare_ends(lead: str, limit: str) -> list[Declared]:
    """Return criteria of the feedback torque in cycle 200 relative to cycle 50, and of both torques."""
    of = {"part": "lead", "lead": lead}
    return [
        {"quantity": "feedback torque of cycle 200 over that of cycle 50", "of": of, "limit": limit,
         "value": lambda runs: compute_growth(runs.end("feedback_rms", 1), runs.at(50, "feedback_rms"))},
        *({"quantity": "feedback torque", "value": value, "of": of, "case": case, "limit": "any N m"}
          for value, case in (
              (lambda runs: runs.at(50, "feedback_rms"), "cycle 50"),
              (lambda runs: runs.end("feedback_rms", 1), "cycle 200"),
          )),
    ]  # fmt: skip


STUDY = declare(
    title="Robots of today",
    question="Do CMAC, models and iterative learning make today's quadrupeds walk accurately with gains by one rule, "
    "and what is each part of the method worth?",
    common={"set": WALK, "quick": {"cycles": 2}, "seeds": True},
    runs=[
        {"over": {"robot": ROBOTS, "period": {"period by rule": learn(100),
                                             "period of 1 ms": {**learn(100), "sampling_period": 0.001}}},
         "labels": {"part": "starts"}},
        {"over": {"robot": ROBOTS, "kind": KINDS}, "labels": {"part": "feedforwards"}},
        {"set": {**WALK, **GROUNDS["rigid ground"]}, "labels": {"part": "ground"},
         "over": {"robot": ROBOTS, "kind": {kind: KINDS[kind] for kind in ("feedback only", "CMAC")}}},
        {"over": {"robot": OTHERS, "kind": {"feedback only": ALONE, "CMAC": learn(20)}},
         "labels": {"part": "others"}},
        {"set": {**WALK, "cycles": 25, "feedforward": "cmac"}, "over": {"robot": GO1, "without": WITHOUT},
         "labels": {"part": "left out"}},
        {"set": {**WALK, "cycles": 200, "feedforward": "cmac"}, "labels": {"part": "lead"},
         "over": {"robot": GO1, "lead": {"lead of one sample": {}, "no lead": {"learning.lead": 0}}}},
        {"set": {"scenario": "quadruped", "gait.load_ramp": 0.12, "cycles": 20, "record.cycles": ["${cycles}"]},
         "over": {"force_control.load_rate": ["false", "true"]}, "labels": {"part": "planar"}},
    ],
    findings={
        "completed": {
            "says": "With every feedforward at least 70 % of the walks complete", **COMPLETE,
            "of": {"part": "feedforwards"},
            "each": {"kind": ["feedback only", "nominal model", "CMAC", "ILC", "RBF", "feedback only, lighter robot",
                              "model 20 % too heavy", "CMAC on that model", "CMAC, lighter robot"]},
        },
        "position_{kind}": {
            "for": {"kind": ["feedback only", "nominal model", "model 20 % too heavy", "CMAC", "CMAC on that model",
                             "ILC", "RBF"]},
            "says": "With “{kind}” the transfer error of every robot is at most 0.5 mm", "limit": "at most 0.5 mm",
            "quantity": "foot error", "of": {"part": "feedforwards", "kind": "{kind}"},
            "value": lambda runs: runs.end("transfer_rmse", 1), "each": EACH,
        },
        "force_{kind}": {
            "for": {"kind": ["nominal model", "CMAC", "ILC", "RBF"]},
            "says": "With “{kind}” the force error of every robot is at most a quarter of that with feedback only",
            **FORCE, "of": {"part": "feedforwards", "kind": "{kind}"},
        },
        "force_{heavy}": {
            "for": {"heavy": ["model 20 % too heavy", "CMAC on that model"]},
            "says": "With “{heavy}” the force error of every robot is at most a quarter of that with feedback only",
            **FORCE, "of": {"part": "feedforwards", "kind": "{heavy}"},
            "over": {"kind": "feedback only, lighter robot"},
        },
        "position_left": {
            "says": "With the CMAC the transfer error of every robot is at most 5 % of that with feedback only",
            **POSITION,
        },
        "posture": {
            "says": "With the CMAC the joint error and the tilt of the trunk are at most 1 mrad on every robot",
            "criteria": [
                {"quantity": name, "value": partial(Results.end, name=metric, cycles=1), "of": CMAC, "each": EACH,
                 "limit": "at most 1 mrad"}
                for name, metric in (("joint error", "joint_rmse"), ("tilt", "tilt_max"))
            ],
        },
        "share": {
            "says": "The CMAC provides at least 95 % of the torque on every robot",
            "quantity": "feedforward over all torque", "of": CMAC, "each": EACH,
            "value": lambda runs: runs.end("feedforward_share", 1),
            "limit": "at least 95 %",
        },
        "better_position": {
            "says": "On every robot the transfer error with the CMAC is below that with the nominal model",
            **POSITION, "quantity": "transfer error over that with the nominal model",
            "over": {"kind": "nominal model"}, "limit": "at most 100 %",
        },
        "better_force": {
            "says": "On every robot the force error with the CMAC is below that with the nominal model",
            **FORCE, "quantity": "force error over that with the nominal model", "of": CMAC,
            "over": {"kind": "nominal model"}, "limit": "at most 100 %",
        },
        "on_model": {
            "says": "By cycle 20, a CMAC on the wrong model is as accurate as a CMAC without one on every robot",
            "criteria": [
                {"quantity": f"{error} error of cycle 20 over that of the CMAC without a model",
                 "value": partial(Results.at, cycle=20, name=f"{error}_rmse"),
                 "of": {"part": "feedforwards", "kind": "CMAC on that model"},
                 "over": {"kind": "CMAC, lighter robot"}, "each": EACH, "limit": "at most 1.1"}
                for error in ("transfer", "force")
            ],
        },
        "lasts": {
            "says": "Sampled every millisecond, walks from disturbed starts complete 100 cycles", **COMPLETE,
            "of": {"part": "starts", "period": "period of 1 ms"},
        },
        "lasts_by_rule": {
            "says": "With the sampling period by rule, walks from disturbed starts complete 100 cycles", **COMPLETE,
            "of": {"part": "starts", "period": "period by rule"},
        },
        "further": {
            "says": "The other robots walk with the same rule, with feedback only and with the CMAC", **COMPLETE,
            "of": {"part": "others"},
        },
        "rigid_position": {
            "says": "On the rigid floor learning lowers the transfer error of every robot to at most 5 % of that "
            "with feedback only",
            **POSITION, "of": {"part": "ground", "kind": "CMAC"},
        },
        "rigid_force": {
            "says": "On the rigid floor learning lowers the force error of every robot to at most 25 % of that with "
            "feedback only",
            **FORCE, "of": {"part": "ground", "kind": "CMAC"},
        },
        "felt_{without}": {
            "for": {"without": [*WITHOUT]},
            "says": "The part “{without}” of the method lowers the force error",
            "criteria": [
                {"quantity": "force error of cycle 25 without it, over that with every part",
                 "value": FORCE_25, "of": {"part": "left out", "without": "{without}", "robot": "Go1"},
                 "over": {"part": "starts", "period": "period by rule", "without": None}, "limit": "at least 1.1"},
                {"quantity": "force error of cycle 25", "value": FORCE_25, "limit": "any N",
                 "of": {"part": "starts", "period": "period by rule", "robot": "Go1"}, "case": "with every part"},
                {"quantity": "force error of cycle 25", "value": FORCE_25, "limit": "any N",
                 "of": {"part": "left out", "without": "{without}", "robot": "Go1"}, "case": "without it"},
            ],
        },
        "falls": {
            "says": "Without the posture rate the robot falls while it learns",
            "quantity": "planned time walked", "value": lambda runs: runs.lasted,
            "of": {"part": "left out", "without": "posture rate"}, "limit": "at most 90 %",
        },
        "grows": {
            "says": "Without lead the feedback torque grows again",
            "criteria": _compare_ends("no lead", "at least 1.1"),
        },
        "holds": {
            "says": "With a lead of one sample the feedback torque stays low",
            "criteria": _compare_ends("lead of one sample", "at most 1.1"),
        },
        "planar": {
            "says": "The rate of the load lowers the force error of the paper's planar quadruped as well",
            "criteria": [
                {"quantity": "force error with the rate of the load over that without", "value": FORCE["value"],
                 "of": {"part": "planar", "force_control.load_rate": True},
                 "over": {"force_control.load_rate": False}, "limit": "at most 1"},
                *({"quantity": "force error", "value": FORCE["value"], "limit": "any N", "case": case,
                   "of": {"part": "planar", "force_control.load_rate": rate}}
                  for rate, case in ((True, "with the rate"), (False, "without it"))),
            ],
        },
    },
    tables={
        "feedforwards": {
            "rows": {"kind": "feedforward"}, "across": "robot", "value": _describe_last,
            "of": {"part": "feedforwards"},
        },
        "learning": {
            "rows": {"robot": "robot", "period": "sampled with"}, "of": {"part": "starts"},
            "columns": {
                **{f"cycle {cycle}, mm / N": partial(_describe_cycle, cycle=cycle)
                   for cycle in (1, 2, 5, 10, 20, 50)},
                "cycle 100, mm / N": _describe_last,
                "completed": completed,
            },
        },
        "left_out": {"rows": {"without": "without"}, "columns": COLUMNS, "of": {"part": "left out"}},
        **{
            name: {"rows": {"robot": "robot", "kind": "feedforward"}, "columns": COLUMNS, "of": {"part": label}}
            for name, label in (("last", "feedforwards"), ("further", "others"), ("ground", "ground"))
        },
    },
    figures={
        **{
            name: [
                {"metric": f"{metric}_rmse", "by": "kind", "log": "y", "title": robot,
                 "of": {"part": "feedforwards", "robot": robot,
                        "kind": ["CMAC", "CMAC, lighter robot", "CMAC on that model", "ILC", "RBF"]}}
                for robot in ROBOTS
            ]
            for name, metric in (("position", "transfer"), ("force", "force"))
        },
        "left_out": {
            "value": FORCE["value"], "over": "without", "y": "force error, N", "title": "left out",
            "kind": "bars", "of": {"part": "left out"},
        },
        "lead": {"metric": "feedback_rms", "by": "lead", "log": "y", "of": {"part": "lead"}},
    },
)  # fmt: skip
