"""A sudden change of speed: transfer of learnt feedforwards to the first cycle at another speed.

``python -m pipelines.speed_change`` needs the extra ``robots``.
"""

from cmacexp.study import Declared, completed, declare, of_completed
from pipelines.robot_walks import LAST, POSITION_LEFT, SPREAD, WALKS

BELOW, PHASE = "identified model below a CMAC", "CMAC over phase"
VELOCITIES = ["CMAC over angles and velocities", "CMAC over phase and velocities"]
TORQUES: Declared = {"act at once": {}, "lag by 15.1 ms": {"actuator": "go2"}}
STARTS: Declared = {"on the path": {}, "disturbed": SPREAD}
LEARNERS: Declared = {
    VELOCITIES[0]: {"feedforward": "cmac", "cmac": "quadruped"},
    VELOCITIES[1]: {"feedforward": "cmac", "cmac": "phase", "cmac.inputs": ["phase", "velocity"]},
    PHASE: {"feedforward": "cmac", "cmac": "phase"},
    "nominal model below a CMAC": {"feedforward": "cmac_on_model", "cmac": "phase"},
    "identified model": {"feedforward": "identified"},
    BELOW: {"feedforward": "identified", "feedforward._target_": "pipelines.cmac_on_identified.CmacOnIdentified",
            "cmac": "phase"},
}  # fmt: skip
OTHERS: Declared = {
    "feedback only": {"feedforward": "none"}, "nominal model": {"feedforward": "inverse_dynamics"},
}  # fmt: skip
TROT: Declared = {
    "scenario": "robot", "machine": "go2", "plant/as_built": "go2", "gait": "trot", "gait.cycle_time": 0.4,
    "plant.start_moving": True, "learning.guard": "none", "gait.speed": 0.3, "cycles": 50, "record": "trace", **LAST,
    "record.weights": True,
}  # fmt: skip
FASTER = {**TROT, "gait.speed": 0.6, "cycles": 6}
FIRST: Declared = {
    **POSITION_LEFT, "quantity": "transfer error of the first cycle over that with feedback only",
    "value": lambda runs: runs.at(1, "transfer_rmse"), "each": {"start": [*STARTS], "torques": [*TORQUES]},
    "beside": None,
    "case": "start {start}, torques {torques}",
}  # fmt: skip


def _run(label: str, kinds: Declared, walk: Declared, **more: Declared) -> Declared:
    return {
        "set": walk, "over": {"torques": TORQUES, "start": STARTS, "kind": kinds}, "labels": {"part": label}, **more,
    }  # fmt: skip


def _of_kinds(*kinds: str) -> Declared:
    """Return keys that repeat a criterion for each kind of feedforward, lag of torques and start."""
    return {"each": {**FIRST["each"], "kind": [*kinds]}, "case": "start {start}, torques {torques}, {kind}"}


STUDY = declare(
    title="A sudden change of speed",
    question="What of a learnt feedforward is of use in the first cycle at another speed: of an identified model, "
    "alone and below a CMAC, and of CMACs over joint angles, velocities and phase?",
    common={"quick": {"cycles": 2}, "seeds": True},
    runs=[
        _run("before", LEARNERS, TROT),
        _run("carried", LEARNERS, FASTER, after={"part": "before"}),
        _run("carried", OTHERS, FASTER),
        _run("before", OTHERS, TROT),
    ],
    findings={
        "walks": {
            "says": "More than half of the walks complete", **WALKS, "of": {"part": "carried"},
            "each": {"torques": [*TORQUES], "kind": ["identified model", BELOW, PHASE]}, "limit": "at least 50 %",
        },
        "identified": {
            "says": "In the first cycle at the new speed an identified model leaves at most half of the transfer "
            "error of feedback only",
            "criteria": [
                {**FIRST, "of": {"part": "carried", "kind": "identified model"}, "limit": "at most 50 %"},
                {"quantity": "transfer error of the first cycle", "value": FIRST["value"], "limit": "any mm",
                 "of": {"part": "carried"}, **_of_kinds(*OTHERS, "identified model", BELOW, PHASE)},
            ],
        },
        "nominal": {
            "says": "There an identified model leaves at most 80 % of the transfer error of the nominal model",
            **FIRST, "quantity": "transfer error of the first cycle over that with the nominal model",
            "of": {"part": "carried", "kind": "identified model"}, "over": {"kind": "nominal model"},
            "limit": "at most 80 %",
        },
        "below": {
            "says": "There an identified model below a CMAC leaves at most 80 % of the transfer error of the CMAC "
            "alone",
            **FIRST, "quantity": "transfer error of the first cycle over that with the CMAC over phase",
            "of": {"part": "carried", "kind": BELOW}, "over": {"kind": PHASE}, "limit": "at most 80 %",
        },
        "phase": {
            "says": "There a CMAC over phase leaves at most half of the transfer error of feedback only",
            **FIRST, "of": {"part": "carried", "kind": PHASE}, "limit": "at most 50 %",
        },
        "addressings": {
            "says": "There CMACs over velocities leave at least 80 % of the transfer error of feedback only",
            **FIRST, "of": {"part": "carried"}, **_of_kinds(*VELOCITIES), "limit": "at least 80 %",
        },
        "adds": {
            "says": "At the old speed a CMAC above it lowers the transfer error of the identified model to at most "
            "80 %",
            **FIRST, "quantity": "transfer error of cycle 50 over that of the identified model alone",
            "value": lambda runs: runs.at(50, "transfer_rmse"), "of": {"part": "before", "kind": BELOW},
            "over": {"kind": "identified model"}, "limit": "at most 80 %",
        },
    },
    tables={
        label: {
            "rows": {"start": "start", "torques": "torques", "kind": "feedforward"}, "of": {"part": label},
            "columns": {"completed": completed, **of_completed(columns)},
        }
        for label, columns in {
            "carried": {
                "cycle 1, mm": lambda runs: 1e3 * runs.at(1, "transfer_rmse"),
                "cycle 1, N": lambda runs: runs.at(1, "force_rmse"),
                "cycle 6, mm": lambda runs: 1e3 * runs.at(6, "transfer_rmse"),
            },
            "before": {
                "cycle 50, mm": lambda runs: 1e3 * runs.at(50, "transfer_rmse"),
                "cycle 50, N": lambda runs: runs.at(50, "force_rmse"),
            },
        }.items()
    },
    figures={
        "carried": [
            {"metric": "transfer_rmse", "by": "kind", "log": "y",
             "of": {"part": "carried", "start": "on the path", "torques": torques}}
            for torques in TORQUES
        ],
    },
)  # fmt: skip
