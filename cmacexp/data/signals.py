"""Declaration of all signals, which are the columns of the tables of a run.

The schemas of the files, the layout of the loop's samples, the ``*_measured`` columns, the arrays that components
exchange and ``docs/files.md`` are derived from it.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import pyarrow as pa

from cmacexp.config.machine import LEG_NAMES

CLOCK, PLAN, PLANT, SENSORS, CONTROLLER, FEEDFORWARD, DERIVED = (
    "clock", "plan", "plant", "sensors", "controller", "feedforward", "trace",
)  # fmt: skip
"""Owners of signals: the components that produce them; the trace owns those that it computes from others."""
SAMPLED = (PLANT, SENSORS, CONTROLLER, FEEDFORWARD)
"""Owners whose signals the loop samples in every step; others are computed before or after the run."""

ALWAYS, IF_ALTERED, IF_WATCHED = "always", "if altered", "if watched"
"""Presence of a column in traces: in every run, if sensors can alter the signal, with fault detection of forces."""


@dataclass(frozen=True)
class Signal:
    """Declaration of a signal, a column of a table."""

    name: str
    unit: str
    meaning: str
    owner: str
    type: pa.DataType = pa.float64()
    altered_by: tuple[str, ...] = ()
    """Sensor signals that can alter this one; a column ``*_measured`` then has the value that the controller gets."""
    present: str = ALWAYS
    """When traces have the column."""


PHASES = ["transfer", "support"]
_NUMBERED = ", ".join(f"{number} {name}" for number, name in enumerate(LEG_NAMES, 1))

LEG_SIGNALS = (
    Signal("step", "", "sampling period, from 0 over the whole run", CLOCK, pa.int32()),
    Signal("time", "s", "start of the step", CLOCK),
    Signal("cycle", "", "gait cycle, from 1, by the machine's clock", CLOCK, pa.int32()),
    Signal("leg", "", f"{_NUMBERED}; 1 for one leg", CLOCK, pa.int32()),
    Signal("phase", "", "planned phase", PLAN, pa.dictionary(pa.int8(), pa.string())),
    Signal("progress", "", "0 to 1 within the phase", PLAN),
    Signal("x_desired", "m", "desired position of the foot, hip frame, x forward", PLAN),
    Signal(
        "y_desired",
        "m",
        "desired position of the foot, hip frame, y down; in support the depression for F_d",
        PLAN,
    ),
    Signal("x_reference", "m", "input of the controller along x", CONTROLLER),
    Signal(
        "y_reference", "m", "input of the controller along y (D_r of eq. 9, 13, 24); NaN where unused", CONTROLLER
    ),
    Signal("x", "m", "position of the foot, hip frame, x forward", PLANT, altered_by=("position",)),
    Signal("y", "m", "position of the foot, hip frame, y down", PLANT, altered_by=("position",)),
    Signal("vx", "m/s", "velocity of the foot in the hip frame", PLANT, altered_by=("position", "velocity")),
    Signal("vy", "m/s", "velocity of the foot in the hip frame", PLANT, altered_by=("position", "velocity")),
    Signal("q1", "rad", "joint angle theta1; NaN without joints", PLANT, altered_by=("position",)),
    Signal("q2", "rad", "joint angle theta2; NaN without joints", PLANT, altered_by=("position",)),
    Signal("dq1", "rad/s", "joint velocity", PLANT, altered_by=("velocity",)),
    Signal("dq2", "rad/s", "joint velocity", PLANT, altered_by=("velocity",)),
    Signal("force", "N", "contact force, positive pressing on the ground", PLANT, altered_by=("force",)),
    Signal("force_desired", "N", "desired contact force", PLAN),
    Signal("force_measured", "N", "contact force measured by the controller", SENSORS),
    Signal("tau_feedback_1", "N m", "feedback torque of joint 1 (Cartesian force in N for a point mass)", CONTROLLER),
    Signal("tau_feedback_2", "N m", "feedback torque of joint 2 (Cartesian force in N for a point mass)", CONTROLLER),
    Signal("tau_feedforward_1", "N m", "feedforward torque of joint 1; the plant gets the sum of both", FEEDFORWARD),
    Signal("tau_feedforward_2", "N m", "feedforward torque of joint 2; the plant gets the sum of both", FEEDFORWARD),
    Signal(
        "force_trusted",
        "",
        "1 while the controller trusts the force sensor; 0 after it was implausible",
        CONTROLLER,
        pa.int8(),
        present=IF_WATCHED,
    ),
)
"""Columns of ``trace.parquet``: one row per step and leg."""

SPATIAL_SIGNALS = (
    Signal("z_desired", "m", "desired position of the foot, hip frame, z to the left", PLAN),
    Signal("z_reference", "m", "input of the controller along z", CONTROLLER),
    Signal("z", "m", "position of the foot, hip frame, z to the left", PLANT, altered_by=("position",)),
    Signal("vz", "m/s", "velocity of the foot in the hip frame", PLANT, altered_by=("position", "velocity")),
    *(Signal(f"q{n}_desired", "rad", f"planned joint angle theta{n}", PLAN) for n in (1, 2, 3)),
    Signal("q3", "rad", "joint angle theta3", PLANT, altered_by=("position",)),
    Signal("dq3", "rad/s", "joint velocity", PLANT, altered_by=("velocity",)),
    Signal("tau_feedback_3", "N m", "feedback torque of joint 3", CONTROLLER),
    Signal("tau_feedforward_3", "N m", "feedforward torque of joint 3; the plant gets the sum of both", FEEDFORWARD),
    *(
        Signal(f"tau_force_{n}", "N m", f"part of tau_feedback_{n} that is no learning error: J^T F_d", CONTROLLER)
        for n in (1, 2, 3)
    ),
)
"""Further columns of ``trace.parquet`` of a robot, whose legs move in space, after :data:`LEG_SIGNALS`."""

MODEL_SIGNALS = tuple(
    Signal(f"tau_model_{n}", "N m", f"part of tau_feedforward_{n} from a model, before the actuator", PLAN)
    for n in (1, 2, 3)
)
"""Further columns of ``trace.parquet`` if the feedforward learns on top of a model, one per joint of a leg."""

TRUE_MARGIN_SIGNALS = (
    Signal(
        "true_stability_margin",
        "m",
        "from the true centre of gravity to the nearest edge of the polygon of the feet with force > 0, tilt and "
        "payload included; NaN with fewer than three",
        DERIVED,
    ),
    Signal("true_margin_front", "m", "as true_stability_margin, to the front boundary along the body's x", DERIVED),
    Signal("true_margin_rear", "m", "as true_stability_margin, to the rear boundary along the body's x", DERIVED),
)
TRUE_MARGINS = tuple(signal.name for signal in TRUE_MARGIN_SIGNALS)
"""Names of :data:`TRUE_MARGIN_SIGNALS`, which are computed from the traces of body and legs."""
BODY_SIGNALS = (
    Signal("step", "", "sampling period, from 0 over the whole run", CLOCK, pa.int32()),
    Signal("time", "s", "start of the step", CLOCK),
    Signal("cycle", "", "gait cycle, from 1", CLOCK, pa.int32()),
    Signal("height", "m", "centre of the body above the undepressed ground below it", PLANT, altered_by=("height",)),
    Signal("pitch", "rad", "positive nose down", PLANT, altered_by=("tilt",)),
    Signal("roll", "rad", "positive right side down", PLANT, altered_by=("tilt",)),
    Signal(
        "yaw",
        "rad",
        "positive turned to the left; 0 unless the plant moves the body by itself",
        PLANT,
        altered_by=("travel",),
    ),
    Signal(
        "cog_x",
        "m",
        "centre of gravity in the world, forward; stroke/(duty factor x T) times time unless the plant moves it",
        PLANT,
        altered_by=("travel",),
    ),
    Signal("cog_y", "m", "centre of gravity in the world, left", PLANT, altered_by=("travel",)),
    Signal("stability_margin", "m", "to the nearest edge of the planned support polygon (McGhee & Frank 1968)", PLAN),
    Signal("margin_front", "m", "to the front boundary of the planned support polygon along the body's x", PLAN),
    Signal("margin_rear", "m", "to the rear boundary of the planned support polygon along the body's x", PLAN),
    Signal("supporting_legs", "", "bit mask of feet with force > 0, leg 1 the lowest bit", DERIVED, pa.int32()),
    *TRUE_MARGIN_SIGNALS,
    Signal("height_rate", "m/s", "rate of the height", PLANT, altered_by=("height_rate",), present=IF_ALTERED),
    Signal("pitch_rate", "rad/s", "rate of the pitch", PLANT, altered_by=("tilt_rate",), present=IF_ALTERED),
    Signal("roll_rate", "rad/s", "rate of the roll", PLANT, altered_by=("tilt_rate",), present=IF_ALTERED),
)
"""Columns of ``body.parquet``: one row per step."""

LIVE_SIGNALS = (
    Signal(
        "answer_time",
        "s",
        "time from the state of the machine to the command computed from it; NaN if none was sent",
        PLANT,
    ),
    Signal(
        "states_missed", "", "states sent but not received since the run began; NaN if no command was sent", PLANT
    ),
)
"""Further columns of ``body.parquet`` of a real machine, after :data:`BODY_SIGNALS`.

A step whose ``answer_time`` exceeds a sampling period is an overrun.
"""

LEARNS, REPEATED, FEEDBACK_ALONE = range(3)
"""States of the guard of learning in ``memory.parquet``."""
GUARD_STATES = f"{LEARNS} learning, {REPEATED} the torque of the best cycle acts, {FEEDBACK_ALONE} feedback only"
MEMORY_SIGNALS = (
    Signal("cycle", "", "gait cycle, from 1", CLOCK, pa.int32()),
    Signal("leg", "", "leg, as in the trace", CLOCK, pa.int32()),
    Signal("weight_norm", "N m", "Euclidean norm of all weights of the network at the end of the cycle", FEEDFORWARD),
    Signal("weight_largest", "N m", "largest absolute weight at the end of the cycle", FEEDFORWARD),
    Signal("rows_used", "", "rows of memory with a weight other than 0 at the end of the cycle", FEEDFORWARD),
    Signal("rows", "", "rows of memory that the network has", PLAN),
    Signal(
        "cells_colliding", "", "cells of the planned path that share their row with another; NaN if not counted", PLAN
    ),
    Signal("guard", "", f"guard of learning at the end of the cycle: {GUARD_STATES}", CONTROLLER),
)
"""Columns of ``memory.parquet``: one row per cycle and leg."""

ARRAYS = {
    "q": ("q1", "q2", "q3"),
    "dq": ("dq1", "dq2", "dq3"),
    "foot": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
    "force": ("force",),
    "body": ("height", "pitch", "roll"),
    "body_rate": ("height_rate", "pitch_rate", "roll_rate"),
    "travel": ("cog_x", "cog_y", "yaw"),
    "feedback": ("tau_feedback_1", "tau_feedback_2", "tau_feedback_3"),
    "feedforward": ("tau_feedforward_1", "tau_feedforward_2", "tau_feedforward_3"),
    "reference": ("x_reference", "y_reference", "z_reference"),
}
"""Signals by the array in which components exchange them; those of a third joint or axis only if legs move in space.

The arrays up to ``travel`` are the fields of a measurement.
"""


def select_signals(
    table: Sequence[Signal], altered: Collection[str] = (), watched: bool = False
) -> tuple[Signal, ...]:
    """Select the columns of a run from ``table``, with the ``*_measured`` ones after the true ones.

    Args:
        table: Declared signals.
        altered: Sensor signals that the sensors of the run can alter.
        watched: True if fault detection checks the force sensors.
    """

    def is_altered(signal: Signal) -> bool:
        return any(name in altered for name in signal.altered_by)

    true = [s for s in table if s.present == ALWAYS or (s.present == IF_ALTERED and is_altered(s))]
    names = {signal.name for signal in true}
    measured = [
        Signal(f"{s.name}_measured", s.unit, f"{s.name} measured by the controller", SENSORS)
        for s in true
        if is_altered(s) and f"{s.name}_measured" not in names
    ]
    return (*true, *measured, *(s for s in table if s.present == IF_WATCHED and watched))


def list_samples(table: Sequence[Signal], wide: bool) -> tuple[str, ...]:
    """List the signals that the loop samples, in column order; if ``wide`` with all optional columns."""
    all_altering = {name for signal in table for name in signal.altered_by}
    columns = select_signals(table, all_altering if wide else (), watched=wide)
    return tuple(signal.name for signal in columns if signal.owner in SAMPLED)


def list_array_units() -> dict[str, str]:
    """List the unit of each of :data:`ARRAYS`, or the units of its columns, separated by commas, if they differ."""
    units = {signal.name: signal.unit for signal in (*LEG_SIGNALS, *SPATIAL_SIGNALS, *BODY_SIGNALS)}
    columns = {array: [units[name] for name in names] for array, names in ARRAYS.items()}
    return {array: unit[0] if len(set(unit)) == 1 else ", ".join(unit) for array, unit in columns.items()}


def make_schema(signals: Sequence[Signal]) -> pa.Schema:
    """Make the Arrow schema of signals, with unit and meaning in the metadata of each field."""
    return pa.schema([pa.field(s.name, s.type, metadata={"unit": s.unit, "meaning": s.meaning}) for s in signals])
