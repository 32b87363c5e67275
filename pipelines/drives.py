"""Robots on drives with position loops, with unmodelled delays, jitter and lost commands: walking and learning.

``python -m pipelines.drives`` needs the extra ``robots``.
"""

from cmacexp.study import Declared, declare
from pipelines.robot_walks import (
    ALONE,
    ENDS,
    FORCE_LEFT,
    GROUNDS,
    LAST,
    POSITION_LEFT,
    SPREAD,
    WALKS,
    each_within,
    end_within,
)

ROBOTS = {
    "Go1": {"machine": "go1", "plant/as_built": "go2_dim"}, "Go2": {"machine": "go2", "plant/as_built": "go2"},
}  # fmt: skip
WORLDS = {
    "lag of 5 ms": {"actuator.lag": 0.005},
    "lag of 5 ms and 6 ms more": {"actuator.lag": 0.005, "plant.delay": 3},
    "lag of 15.1 ms and 4 ms more": {"actuator.lag": 0.0151, "plant.delay": 2},
    "lag of 20 ms and 6 ms more": {"actuator.lag": 0.02, "plant.delay": 3},
}
LATE = ["lag of 5 ms and 6 ms more", "lag of 20 ms and 6 ms more"]
"""Worlds with the longest unmodelled delay."""
GAITS: dict[str, tuple[Declared, int, str, str]] = {
    "crawl": ({}, 60, "0.7", "3"),
    "trot": ({"gait": "trot", "gait.speed": 0.4}, 200, "1", "9"),
}
"""Overrides; cycles with a CMAC; limits of the final transfer error, mm, and force error, N."""
ON_DRIVES: Declared = {
    "scenario": "robot", **SPREAD, "controller": "drives", **LAST, "plant.bus.jitter": 0.001, "plant.bus.loss": 0.01,
    "plant.bus.seed": "${seed}",
}  # fmt: skip
LEARNS: Declared = {"feedforward": "cmac", "learning.lead": "estimate", "learning.rate": 0.025}
EVERY: Declared = {"robot": ROBOTS, "ground": GROUNDS}
EACH = {"robot": [*ROBOTS], "ground": [*GROUNDS]}


STUDY = declare(
    title="Drives with loops of their own",
    question="Do robots walk, and learn position and force, when their drives close loops of their own, commands "
    "arrive later than anybody counted, jitter or are lost?",
    common={"set": ON_DRIVES, "quick": {"cycles": 2, "learning.lead": "auto"}, "seeds": True},
    runs=[
        *(
            {"set": {**ON_DRIVES, **gait_overrides}, "labels": {"gait": gait},
             "over": {**EVERY, "world": WORLDS,
                      "kind": {"feedback only": ALONE, "CMAC": {**LEARNS, "cycles": cycles}}}}
            for gait, (gait_overrides, cycles, _, _) in GAITS.items()
        ),
        {"set": {**ON_DRIVES, "feedforward": "cmac"}, "quick": None, "labels": {"kind": "CMAC, counted lead"},
         "over": {**EVERY, "world": {name: WORLDS[name] for name in LATE},
                  "gait": {gait: {**values, "cycles": cycles} for gait, (values, cycles, _, _) in GAITS.items()}}},
        {"set": {"scenario": "robot", **SPREAD, "sampling_period": 0.001, **ALONE}, "quick": {"cycles": 2},
         "over": {**EVERY, "gait": {gait: gait_overrides for gait, (gait_overrides, *_) in GAITS.items()},
                  "world": {"lag of 15.1 ms": {"actuator.lag": 0.0151},
                            "lag of 15.1 ms and 4 ms more": {"actuator.lag": 0.0151, "plant.delay": 4}}},
         "labels": {"kind": "torques at 1 kHz"}},
    ],
    findings={
        "walks": {
            "says": "On drives with loops of their own walks complete", **WALKS, "limit": "at least 90 %",
            "of": {"kind": ["feedback only", "CMAC"]},
            "each": {"gait": [*GAITS], "kind": ["feedback only", "CMAC"]},
        },
        "torques": {
            "says": "With torques at 1 kHz hardly any walk completes where nobody counted a delay of 4 ms", **WALKS,
            "of": {"kind": "torques at 1 kHz"}, "each": {"world": ["lag of 15.1 ms and 4 ms more"]},
            "limit": "at most 20 %",
        },
        "torques_counted": {
            "says": "Without that delay they complete", **WALKS, "limit": "at least 75 %",
            "of": {"kind": "torques at 1 kHz", "world": "lag of 15.1 ms"}, "each": {"gait": [*GAITS]},
        },
        "position_{gait}": {
            "for": {"gait": [*GAITS]},
            "says": "In a {gait} learning lowers the transfer error to a tenth", **POSITION_LEFT, "each": EACH,
            "of": {"gait": "{gait}", "kind": "CMAC"}, "limit": "at most 10 %",
        },
        "force_{gait}": {
            "for": {"gait": [*GAITS]},
            "says": "In a {gait} learning lowers the force error to half", **FORCE_LEFT, "each": EACH,
            "of": {"gait": "{gait}", "kind": "CMAC"}, "limit": "at most 50 %",
        },
        **{
            f"{gait}_ends": {
                "says": f"A {gait} ends at {position} mm and {force} N or less",
                "criteria": end_within(position, force, {"gait": gait, "kind": "CMAC"}, EACH),
            }
            for gait, (_, _, position, force) in GAITS.items()
        },
        **{
            f"each_{gait}": {
                "says": f"In every world at least three quarters of the {gait}s end at {position} mm and {force} N "
                "or less, each by itself",
                **each_within(gait, position, force, {"gait": gait, "kind": "CMAC"}, {"world": [*WORLDS]}),
            }
            for gait, (_, _, position, force) in GAITS.items()
        },
        "each_counted": {
            "says": "With the lead that is counted, and its rate, three quarters end there in the two worlds with "
            "the longest delay that nobody counted",
            "criteria": [
                each_within(
                    gait, position, force, {"gait": gait, "kind": "CMAC, counted lead"}, {"world": LATE},
                    case=f"{{world}}, {gait}s",
                )
                for gait, (_, _, position, force) in GAITS.items()
            ],
        },
    },
    tables={
        "walks": {
            "rows": {name: name for name in ("gait", "robot", "ground", "world", "kind")}, "columns": ENDS,
            "of": {"kind": ["feedback only", "CMAC"]},
        },
    },
)  # fmt: skip
