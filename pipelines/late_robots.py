"""Robots with delayed feedback: walking and learning with encoders, delayed torques and lags.

``python -m pipelines.late_robots`` needs the extra ``robots``.
"""

from cmacexp.study import Declared, declare
from pipelines.robot_walks import ALONE, ENDS, FORCE_LEFT, OTHERS, POSITION, ROBOTS, WALK, WALKS, learn

WORLDS: dict[str, Declared] = {
    "encoders": {"sensors": "encoders"},
    "encoders and late torque": {"sensors": "encoders", "actuator.delay": 1},
    "lag": {"actuator.lag": 0.005},
}
ALL = {**ROBOTS, **OTHERS}
LASTING = ["Go1", "Aliengo"]
"""Robots in the long walks."""
EVERYWHERE: Declared = {"for": {"world": [*WORLDS]}, "each": {"robot": [*ALL]}}
"""Keys that repeat a finding in each world, with a value for each robot."""
LEARNS = {"part": "all", "world": "{world}", "kind": "CMAC"}

STUDY = declare(
    title="Robots with delayed feedback",
    question="Do robots walk and learn when encoders and actuators delay their feedback, with gains, sampling "
    "period, lead and rate by rule?",
    common={"set": WALK, "quick": {"cycles": 2}, "seeds": True},
    runs=[
        {"over": {"robot": ALL, "world": WORLDS, "kind": {"feedback only": ALONE, "CMAC": learn(50)}},
         "labels": {"part": "all"}},
        {"set": {**WALK, "sensors": "encoders", "cycles": 200}, "labels": {"part": "long"},
         "over": {"robot": {robot: ALL[robot] for robot in LASTING}}},
    ],
    findings={
        "walks": {
            "says": "With delayed feedback the robots walk to the end, with a CMAC and with feedback only", **WALKS,
            "of": {"part": "all"}, "limit": "at least 90 %",
        },
        "lasts": {
            "says": "With encoders Go1 and Aliengo complete long walks", **WALKS, "of": {"part": "long"},
            "each": {"robot": LASTING}, "limit": "at least 50 %",
        },
        "accurate": {
            "says": "Go1 and Aliengo stay accurate in long walks", **POSITION,
            "quantity": "transfer error at the end", "of": {"part": "long"}, "each": {"robot": LASTING},
            "limit": "at most 1.2 mm",
        },
        "alone_{world}": {
            "says": "With {world} and feedback only the transfer error of every robot is at most 30 mm", **EVERYWHERE,
            **POSITION, "quantity": "foot error with feedback only", "limit": "at most 30 mm",
            "of": {"part": "all", "world": "{world}", "kind": "feedback only"},
        },
        "position_{world}": {
            "says": "With {world} and a CMAC the transfer error of every robot is at most 1.2 mm", **EVERYWHERE,
            **POSITION, "quantity": "foot error with a CMAC", "limit": "at most 1.2 mm", "of": LEARNS,
        },
        "force_{world}": {
            "says": "With {world}, learning lowers the force error of every robot", **EVERYWHERE, **FORCE_LEFT,
            "of": LEARNS, "limit": "at most 100 %",
        },
    },
    tables={
        "periods": {
            "rows": "robot", "across": "world", "value": lambda runs: 1e3 * runs.value("sampling_period"),
            "of": {"part": "all", "kind": "CMAC"},
        },
        "errors": {
            "rows": {"robot": "robot", "world": "delay", "kind": "feedforward"}, "of": {"part": "all"},
            "columns": {name: column for name, column in ENDS.items() if name != "completed"},
        },
    },
    figures={"long": {"metric": "transfer_rmse", "by": "robot", "log": "y", "of": {"part": "long"}}},
)  # fmt: skip
