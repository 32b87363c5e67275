"""Robots on drives with position loops, harder: other speeds, 1 kHz, delayed readings, encoder offsets, a push.

``python -m pipelines.drives_harder`` needs the extra ``robots``.
"""

from cmacexp.study import Declared, declare
from pipelines.drives import LEARNS, ROBOTS
from pipelines.robot_walks import (
    ALONE,
    ENDS,
    FORCE,
    GROUNDS,
    LAST,
    ON_BOTH,
    POSITION,
    SPREAD,
    WALKS,
    each_within,
    end_within,
)

TROT = {"gait": "trot", "gait.speed": 0.4}
LAGGING = {"world": "lag of 15.1 ms and 4 ms more"}
START: Declared = {
    "scenario": "robot", "controller": "drives", **SPREAD, **LAST, "plant.bus.jitter": 0.001, "plant.bus.loss": 0.01,
    "plant.bus.seed": "${seed}", "actuator.lag": 0.0151, "plant.delay": 2,
}  # fmt: skip
CASES: dict[str, Declared] = {
    "0.2 m/s": {"gait": "trot", "gait.speed": 0.2},
    "0.8 m/s": {"gait": "trot", "gait.speed": 0.8},
    "1 kHz": {**TROT, "sampling_period": 0.001, "plant.substeps": 4, "plant.delay": 4},
    "late readings": {**TROT, "sensors": "real", "sensors.position.delay": 2, "sensors.velocity.delay": 2},
    "encoders off": {**TROT, "sensors": "real", "sensors.position.bias": 0.005},
}
BY_OWN_SENSORS: dict[str, tuple[Declared, int, str, str]] = {
    "own sensors": (TROT, 200, "1.5", "11"), "own sensors, crawl": ({}, 60, "1", "5"),
}  # fmt: skip
"""Walks with the robot's own sensors: gait; cycles; limits of the final transfer error, mm, and force error, N."""
WORLDS: dict[str, Declared] = {
    "lag of 5 ms": {"actuator.lag": 0.005, "plant.delay": 0},
    "lag of 5 ms and 6 ms more": {"actuator.lag": 0.005, "plant.delay": 3},
    "lag of 15.1 ms and 4 ms more": {},
    "lag of 20 ms and 6 ms more": {"actuator.lag": 0.02, "plant.delay": 3},
}
GO2 = {"Go2": ROBOTS["Go2"]}


STUDY = declare(
    title="Drives with loops of their own, harder",
    question="Do robots on drives walk and learn at other speeds, at 1 kHz, with late readings, encoders that are "
    "off, a push, and by what they measure themselves?",
    common={"set": START, "quick": {"cycles": 2, "learning.lead": "auto"}, "seeds": True},
    runs=[
        {"over": {"robot": GO2, "ground": GROUNDS, "case": CASES,
                  "kind": {"feedback only": ALONE, "CMAC": {**LEARNS, "cycles": 100}}}, "labels": LAGGING},
        {"set": {**START, **TROT, "plant.push": 90, "plant.push_time": 3, "cycles": 30},
         "over": {"robot": GO2, "ground": GROUNDS,
                  "kind": {"feedback only": {"feedforward": "none"}, "CMAC": {"feedforward": "cmac"}}},
         "labels": {"case": "push", **LAGGING}},
        *(
            {"set": {**START, "sensors": "proprioceptive", "plant.bus.velocity_lag": 0.002, **gait},
             "over": {"robot": ROBOTS, "ground": GROUNDS, "world": WORLDS,
                      "kind": {"feedback only": ALONE, "CMAC": {**LEARNS, "cycles": cycles}}},
             "labels": {"case": case}}
            for case, (gait, cycles, _, _) in BY_OWN_SENSORS.items()
        ),
    ],
    findings={
        "walks": {
            "says": "On drives with loops of their own walks complete", **WALKS, "limit": "at least 90 %",
        },
        "trots": {
            "says": "A trot of a Go2 ends at 1 mm and 9 N or less",
            "criteria": [
                *end_within("1", "9", {"kind": "CMAC"}, {"case": [*CASES]}),
                *({**error, "of": {"kind": "feedback only"}, "each": {"case": [*CASES]}, "limit": f"any {unit}"}
                  for error, unit in ((POSITION, "mm"), (FORCE, "N"))),
            ],
        },
        "pushes": {
            "says": "Of the robots that are pushed aside with 90 N at least half walk on", **WALKS,
            "of": {"case": "push"}, "limit": "at least 50 %",
        },
        "own_walks": {
            "says": "By what robots measure themselves walks complete", **WALKS, "of": {"case": [*BY_OWN_SENSORS]},
            "limit": "at least 98 %",
        },
        **{
            f"own_{gait}": {
                "says": f"By what a robot measures itself a {gait} ends at {position} mm and {force} N or less",
                "criteria": end_within(position, force, {"case": case, "kind": "CMAC"}, {"robot": [*ROBOTS]}),
            }
            for gait, (case, (_, _, position, force)) in zip(("trot", "crawl"), BY_OWN_SENSORS.items(), strict=True)
        },
        **{
            f"each_own_{gait}": {
                "says": f"On either ground at least three quarters of the {gait}s end there, each by itself",
                **each_within(gait, position, force, {"case": case, "kind": "CMAC"}, ON_BOTH),
            }
            for gait, (case, (_, _, position, force)) in zip(("trot", "crawl"), BY_OWN_SENSORS.items(), strict=True)
        },
    },
    tables={
        "walks": {
            "rows": {name: name for name in ("case", "robot", "ground", "world", "kind")}, "columns": ENDS,
        },
    },
)  # fmt: skip
