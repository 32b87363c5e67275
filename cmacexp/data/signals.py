"""The trace of a run: one row per step and leg; Parquet on disk is the truth."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import pyarrow as pa


@dataclass(frozen=True)
class Column:
    """Name, unit and meaning of a column, and its Arrow type."""

    name: str
    unit: str
    meaning: str
    type: pa.DataType = pa.float64()
    added: bool = False
    """Whether traces of earlier versions lack it."""


PHASES = ["transfer", "support"]
LEG_NAMES = ("left front", "right front", "left rear", "right rear")
"""Of legs 1 to 4 under a body."""

COLUMNS = (
    Column("step", "", "sampling period, from 0 over the whole run", pa.int32()),
    Column("time", "s", "start of the step"),
    Column("cycle", "", "gait cycle, from 1, by the machine's clock", pa.int32()),
    Column("leg", "", "1 left front, 2 right front, 3 left rear, 4 right rear; 1 for one leg", pa.int32()),
    Column("phase", "", "planned phase", pa.dictionary(pa.int8(), pa.string())),
    Column("progress", "", "0 to 1 within the phase"),
    Column("x_desired", "m", "where the foot should really be, hip frame, x forward"),
    Column(
        "y_desired",
        "m",
        "where the foot should really be, hip frame, y down; in support the depression for F_d",
    ),
    Column("x_reference", "m", "what the controller is fed along x"),
    Column("y_reference", "m", "what the controller is fed along y (D_r of eq. 9, 13, 24); NaN where unused"),
    Column("x", "m", "foot, hip frame, x forward"),
    Column("y", "m", "foot, hip frame, y down"),
    Column("vx", "m/s", "velocity of the foot in the hip frame"),
    Column("vy", "m/s", "velocity of the foot in the hip frame"),
    Column("q1", "rad", "joint angle theta1; NaN without joints"),
    Column("q2", "rad", "joint angle theta2; NaN without joints"),
    Column("dq1", "rad/s", "joint velocity"),
    Column("dq2", "rad/s", "joint velocity"),
    Column("force", "N", "contact force, positive pressing on the ground"),
    Column("force_desired", "N", "desired contact force"),
    Column("force_measured", "N", "contact force as the controller saw it"),
    Column("tau_feedback_1", "N m", "feedback torque of joint 1 (Cartesian force in N for a point mass)"),
    Column("tau_feedback_2", "N m", "feedback torque of joint 2 (Cartesian force in N for a point mass)"),
    Column("tau_feedforward_1", "N m", "feedforward torque of joint 1; the plant gets the sum of both"),
    Column("tau_feedforward_2", "N m", "feedforward torque of joint 2; the plant gets the sum of both"),
)

BODY_COLUMNS = (
    Column("step", "", "sampling period, from 0 over the whole run", pa.int32()),
    Column("time", "s", "start of the step"),
    Column("cycle", "", "gait cycle, from 1", pa.int32()),
    Column("height", "m", "centre of the body above the undepressed ground below it"),
    Column("pitch", "rad", "positive nose down"),
    Column("roll", "rad", "positive right side down"),
    Column("yaw", "rad", "positive turned to the left; 0 unless the plant moves the body by itself", added=True),
    Column(
        "cog_x",
        "m",
        "centre of gravity in the world, forward; stroke/(duty factor x T) times time unless the plant moves it",
    ),
    Column("cog_y", "m", "centre of gravity in the world, left"),
    Column("stability_margin", "m", "to the nearest edge of the planned support polygon (McGhee & Frank 1968)"),
    Column("margin_front", "m", "to the front boundary of the planned support polygon along the body's x"),
    Column("margin_rear", "m", "to the rear boundary of the planned support polygon along the body's x"),
    Column("supporting_legs", "", "bit mask of feet with force > 0, leg 1 the lowest bit", pa.int32()),
)

MEASURED = {
    "x": ("position",),
    "y": ("position",),
    "vx": ("position", "velocity"),
    "vy": ("position", "velocity"),
    "q1": ("position",),
    "q2": ("position",),
    "dq1": ("velocity",),
    "dq2": ("velocity",),
    "height": ("height",),
    "pitch": ("tilt",),
    "roll": ("tilt",),
    "height_rate": ("height_rate",),
    "pitch_rate": ("tilt_rate",),
    "roll_rate": ("tilt_rate",),
}
"""Columns that get a ``*_measured`` beside them where one of these signals of the sensors is altered."""

RATES = (
    Column("height_rate", "m/s", "rate of the height"),
    Column("pitch_rate", "rad/s", "rate of the pitch"),
    Column("roll_rate", "rad/s", "rate of the roll"),
)
"""Columns of a body that stand in its trace where their sensors alter them."""


TRUSTED = Column(
    "force_trusted", "", "1 while the controller goes by the force sensor; 0 since it was implausible", pa.int8()
)
"""Of legs whose force sensors are watched."""


def with_measured(columns: Sequence[Column], altered: Collection[str], watched: bool = False) -> tuple[Column, ...]:
    """Columns of a trace, then those of sensors that alter these signals, and of force sensors that are watched."""

    def is_altered(column: Column) -> bool:
        return any(signal in altered for signal in MEASURED.get(column.name, ()))

    rates = [column for column in RATES if columns is BODY_COLUMNS and is_altered(column)]
    seen = [
        Column(f"{column.name}_measured", column.unit, f"{column.name} as the controller saw it")
        for column in (*columns, *rates)
        if is_altered(column)
    ]
    return (*columns, *rates, *seen, *([TRUSTED] if watched and columns is COLUMNS else []))


MEMORY_COLUMNS = (
    Column("cycle", "", "gait cycle, from 1", pa.int32()),
    Column("leg", "", "as in the trace", pa.int32()),
    Column("weight_norm", "N m", "Euclidean norm of all weights of the network at the end of the cycle"),
    Column("weight_largest", "N m", "largest absolute weight at the end of the cycle"),
    Column("rows_used", "", "rows of memory with a weight other than 0 at the end of the cycle"),
    Column("rows", "", "rows of memory that the network has"),
    Column("cells_colliding", "", "cells of the planned path that share their row with another; NaN if not counted"),
)


def schema_of(columns: Sequence[Column]) -> pa.Schema:
    """Arrow schema of columns, with unit and meaning in the metadata of each field."""
    return pa.schema([pa.field(c.name, c.type, metadata={"unit": c.unit, "meaning": c.meaning}) for c in columns])
