"""A Go2 with the joint dynamics of a real one: gain by learned feedforward with lagging torques, in crawl and trot.

``python -m pipelines.identified_robot`` needs the extra ``robots``.
"""

from cmacexp.study import Declared, declare
from pipelines.robot_walks import (
    ALONE,
    ENDS,
    FORCE,
    FORCE_LEFT,
    GROUNDS,
    LAST,
    MODEL,
    ON_BOTH,
    POSITION,
    POSITION_LEFT,
    SPREAD,
    WALKS,
    learn,
)

WALK: Declared = {"scenario": "robot", "machine": "go2", "plant/as_built": "go2", **SPREAD, **LAST}
GAITS: dict[str, tuple[Declared, int, int, int]] = {
    "crawl": ({}, 50, 10, 50), "trot": ({"gait": "trot", "gait.speed": 0.4}, 200, 30, 60),
}  # fmt: skip
"""Overrides; cycles with a CMAC; limits of its transfer and force error in percent of those of feedback only."""
LAGGING, AT_ONCE = "lag by 15.1 ms", "act at once"
KINDS = ["feedback only", "nominal model", "CMAC"]
STUDY = declare(
    title="A Go2 with the joints of a real one",
    question="What does learned feedforward gain on a Go2 whose joints reproduce the log of a real one, crawling and "
    "trotting, on elastic and rigid ground, with and without the lag of its torques?",
    runs=[
        {"set": {**WALK, **gait_overrides}, "quick": {"cycles": 2}, "labels": {"gait": gait},
         "over": {"torques": {LAGGING: {"actuator": "go2"}, AT_ONCE: {}}, "ground": GROUNDS, "seed": list(range(8)),
                  "kind": {"feedback only": ALONE, "nominal model": MODEL, "CMAC": learn(cycles)}}}
        for gait, (gait_overrides, cycles, _, _) in GAITS.items()
    ],
    findings={
        "walks": {
            "says": "With the lag of its torques the Go2 completes every walk, with each feedforward", **WALKS,
            "of": {"torques": LAGGING}, "each": {"gait": [*GAITS], **ON_BOTH, "kind": KINDS},
            "limit": "at least 60 %",
        },
        "at_once": {
            "says": "Where its torques act at once the Go2 crawls on elastic ground with feedback only",
            "criteria": [
                {**WALKS, "of": {"torques": AT_ONCE, "gait": "crawl", "ground": "elastic ground"},
                 "each": {"kind": ["feedback only", "CMAC"]}, "limit": "at least 60 %"},
                {**WALKS, "of": {"torques": AT_ONCE}, "limit": "any %",
                 "each": {"gait": [*GAITS], "ground": ["rigid ground", "elastic ground"], "kind": KINDS}},
            ],
        },
        **{
            gait: {
                "says": f"In a {gait} with the lag the CMAC leaves at most {position} % of the transfer error and "
                f"{force} % of the force error of feedback only",
                "criteria": [
                    {**error, "of": {"gait": gait, "torques": LAGGING, "kind": "CMAC"}, "each": ON_BOTH,
                     "limit": f"at most {limit} %"}
                    for error, limit in ((POSITION_LEFT, position), (FORCE_LEFT, force))
                ],
            }
            for gait, (_, _, position, force) in GAITS.items()
        },
        "model_{gait}": {
            "for": {"gait": [*GAITS]},
            "says": "In a {gait} with the lag the nominal model leaves less of the transfer error than feedback "
            "only, and more of the force error",
            "criteria": [
                {**error, "of": {"gait": "{gait}", "torques": LAGGING, "kind": "nominal model"}, "each": ON_BOTH,
                 "limit": limit, "beside": None}
                for error, limit in (
                    (POSITION_LEFT, "at most 100 %"), (FORCE_LEFT, "at least 100 %"), (POSITION, "any mm"),
                    (FORCE, "any N"),
                )
            ],
        },
    },
    tables={
        "walks": {
            "rows": {"gait": "gait", "torques": "torques", "ground": "ground", "kind": "feedforward"},
            "columns": ENDS,
        },
    },
    figures={
        "walks": [
            {"metric": metric, "by": "kind", "log": "y",
             "of": {"gait": "crawl", "torques": LAGGING, "ground": "elastic ground"}}
            for metric in ("transfer_rmse", "force_rmse")
        ],
    },
)  # fmt: skip
