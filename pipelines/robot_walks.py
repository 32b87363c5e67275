"""Shared declarations of studies of robots: robots, grounds, starts, feedforwards, and measures of a walk.

Unless a study declares otherwise, walks are repeated with another random start for each seed, and their last cycle is
recorded.
"""

from cmacexp.study import Declared, completed, of_completed

ROBOTS = {
    "Go1": {"machine": "go1"}, "Go2": {"machine": "go2"}, "Aliengo": {"machine": "aliengo"},
    "Mini Cheetah": {"machine": "mini_cheetah"}, "HyQReal1": {"machine": "hyqreal1"},
}  # fmt: skip
"""Robots with which the rules for gains and plans were developed."""
OTHERS = {
    "Spot": {"machine": "spot"}, "A2": {"machine": "a2"}, "B2": {"machine": "b2"},
    "HyQReal2": {"machine": "hyqreal2"}, "Pegasus": {"machine": "pegasus"},
}  # fmt: skip
GROUNDS: dict[str, Declared] = {"elastic ground": {}, "rigid ground": {"plant": "mujoco_robot_rigid"}}
SPREAD: Declared = {"plant.start_spread": 0.05, "plant.start_seed": "${seed}"}
"""Random start beside the planned one, different for each seed."""
LAST: Declared = {"record.cycles": ["${cycles}"]}
WALK: Declared = {"scenario": "robot", **SPREAD, **LAST}
ALONE: Declared = {"feedforward": "none", "cycles": 12}
MODEL: Declared = {"feedforward": "inverse_dynamics", "cycles": 12}
ON_BOTH = {"ground": [*GROUNDS]}
WALKS: Declared = {"quantity": "walks completed", "value": lambda runs: runs.completed}
POSITION: Declared = {"quantity": "transfer error", "value": lambda runs: runs.end("transfer_rmse", 1)}
FORCE: Declared = {"quantity": "force error", "value": lambda runs: runs.end("force_rmse", 1)}
POSITION_LEFT: Declared = {
    **POSITION, "quantity": "transfer error over that with feedback only", "over": {"kind": "feedback only"},
    "beside": "transfer error, mm",
}  # fmt: skip
FORCE_LEFT: Declared = {
    **FORCE, "quantity": "force error over that with feedback only", "over": {"kind": "feedback only"},
    "beside": "force error, N",
}  # fmt: skip
ENDS: Declared = {
    "completed": completed,
    **of_completed(
        {
            "foot error, mm": lambda runs: 1e3 * runs.end("transfer_rmse", 1),
            "force error, N": lambda runs: runs.end("force_rmse", 1),
        }
    ),
}
"""Columns of a table of the last cycle."""


def end_within(position: str, force: str, of: Declared, each: Declared) -> list[Declared]:
    """Return criteria that walks end with at most these errors: ``position``, mm, and ``force``, N."""
    return [
        {**error, "of": of, "each": each, "limit": f"at most {limit}"}
        for error, limit in ((POSITION, f"{position} mm"), (FORCE, f"{force} N"))
    ]


def each_within(gait: str, position: str, force: str, of: Declared, each: Declared, **more: str) -> Declared:
    """Return a criterion that three quarters of the walks end with at most both errors, each walk counted separately.

    ``position`` is in mm, ``force`` in N; ``more`` adds keys to the criterion.
    """
    return {
        "quantity": f"{gait}s within both", "of": of, "each": each, "limit": "at least 75 %", **more,
        "value": lambda runs: (1e3 * runs.end("transfer_rmse", 1) <= float(position))
        & (runs.end("force_rmse", 1) <= float(force)),
    }  # fmt: skip


def learn(cycles: int) -> Declared:
    """Return overrides of a CMAC that learns for ``cycles`` cycles."""
    return {"feedforward": "cmac", "cycles": cycles}
