"""Validation of the output of external components; errors name the component, in the step of its mistake."""

from typing import Any

import numpy as np

from cmacexp.control.protocol import Action, Drive
from cmacexp.data.signals import list_units
from cmacexp.errors import BadOutput
from cmacexp.plants.drives import ANGLE
from cmacexp.plants.protocol import STATE, Measurement, get_state
from cmacexp.plants.robot_signals import RobotSignals
from cmacexp.typing import Array

UNITS = list_units()
UNITS["torque"] = UNITS["learning_error"] = UNITS["signals.torque"] = UNITS["feedback"]
UNITS |= {
    f"drive.{name}": unit for name, unit in zip(Drive._fields, ("rad", "rad/s", "N m/rad", "N m s/rad"), strict=True)
}
UNITS |= {"signals.q": "rad", "signals.dq": "rad/s", "signals.attitude": "rad", "signals.gyroscope": "rad/s"}
UNITS |= {"signals.accelerometer": "m/s^2", "signals.tick": "samples"}

FLOAT = np.dtype(np.float64)


def _method(component: object, name: str) -> str:
    return f"{type(component).__name__}.{name}"


def _expected(name: str, shape: tuple[int, ...], unit: str) -> str:
    sides = "(3,)" if shape == (3,) else "(L, J)" if len(shape) == 2 else "(L,)"
    size = "" if sides == str(shape) else f" = {shape}"
    return f"expected {sides}{size} float64, {unit}"


def copy_output(component: object, method: str, name: str, output: Any, target: Array) -> None:
    """Copy an array that a component returned into ``target``, whose shape and unit it has; raises BadOutput."""
    try:
        if output.dtype is FLOAT and output.shape == target.shape:
            target[...] = output
            return
    except AttributeError:
        pass
    expected = _expected(name, target.shape, UNITS[name])
    try:
        values = np.asarray(output)
        kind = values.dtype.kind
    except (TypeError, ValueError):
        kind, values = "O", np.empty(0)
    if output is None or kind not in "fiub":
        raise BadOutput(f"{_method(component, method)} returned {name} of type {type(output).__name__}: {expected}")
    if values.shape != target.shape:
        raise BadOutput(f"{_method(component, method)} returned {name} of shape {values.shape}: {expected}")
    target[...] = values


def require_finite(component: object, method: str, name: str, values: Array) -> None:
    """Check that ``values``, of any shape and unit, are finite; raises BadOutput that names the first that is not."""
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        where = ", ".join(map(str, bad[0]))
        value = values[tuple(bad[0])]
        raise BadOutput(
            f"{_method(component, method)} returned {name}[{where}] = {value}: expected finite {UNITS[name]}"
        )


def copy_measurement(component: object, method: str, output: Any, target: Measurement) -> None:
    """Copy a measurement that a plant or sensors returned into the arrays of ``target``; raises BadOutput."""
    if not isinstance(output, Measurement):
        raise BadOutput(
            f"{_method(component, method)} returned {_describe(output)}: "
            f"expected cmacexp.plants.Measurement({', '.join(Measurement._fields)})"
        )
    for name, values, array in zip(STATE, output, get_state(target), strict=False):  # but for the travel
        copy_output(component, method, name, values, array)
    if output.travel is not None:
        travel = np.empty(3)
        copy_output(component, method, "travel", output.travel, travel)
        require_finite(component, method, "travel", travel)
        if target.travel is not None:
            target.travel[...] = travel


def copy_action(component: object, output: Any, feedback: Array, feedforward: Array, reference: Array) -> bool:
    """Copy the action of a controller into the arrays (L, J) of the loop, N m and m; raises BadOutput.

    Returns whether it contains the reference that the controller followed.
    """
    if not isinstance(output, Action):
        raise BadOutput(
            f"{_method(component, 'act')} returned {_describe(output)}: "
            "expected cmacexp.control.Action(feedback, feedforward[, reference])"
        )
    copy_output(component, "act", "feedback", output[0], feedback)
    copy_output(component, "act", "feedforward", output[1], feedforward)
    if output[2] is None:
        return False
    copy_output(component, "act", "reference", output[2], reference)
    return True


def copy_drive(component: object, drive: Any, command: Array) -> None:
    """Copy what a controller sends to drives beside its torques into their ``command`` (6, L, J).

    Its units are those of :class:`cmacexp.control.Drive`. None: torques alone, with gains of 0. Raises BadOutput.
    """
    if drive is None:
        command[ANGLE:] = 0.0
        return
    if not isinstance(drive, Drive):
        raise BadOutput(
            f"{_method(component, 'act')} returned drive={_describe(drive)}: "
            f"expected cmacexp.control.Drive({', '.join(Drive._fields)}), or None"
        )
    for name, values, target in zip(Drive._fields, drive, command[ANGLE:], strict=True):
        copy_output(component, "act", f"drive.{name}", values, target)
        require_finite(component, "act", f"drive.{name}", target)


def copy_signals(component: object, method: str, signals: Any, target: RobotSignals) -> None:
    """Copy what a plant says that a robot measures by itself into the arrays of ``target``; raises BadOutput."""
    if not isinstance(signals, RobotSignals):
        raise BadOutput(
            f"{_method(component, method)} returned signals={_describe(signals)}: "
            f"expected cmacexp.plants.RobotSignals({', '.join(RobotSignals._fields)})"
        )
    for name, values, array in zip(RobotSignals._fields, signals, target, strict=True):
        copy_output(component, method, f"signals.{name}", values, array)


def _describe(output: Any) -> str:
    """The kind of a value, in a few words."""
    if isinstance(output, np.ndarray):
        return f"an array of shape {output.shape}"
    return "None" if output is None else f"a {type(output).__name__}"
