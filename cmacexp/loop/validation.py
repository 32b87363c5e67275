"""Validation of the output of external components; errors name the component, in the step of its mistake."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from cmacexp.control.protocol import Action, Drive
from cmacexp.data.signals import list_units
from cmacexp.errors import BadOutput
from cmacexp.plants.protocol import STATE, Measurement, RobotSignals, get_state
from cmacexp.typing import Array

UNITS = list_units()
"""Of all outputs, by name."""
UNITS["force_trusted"] = ""
UNITS["torque"] = UNITS["learning_error"] = UNITS["signals.torque"] = UNITS["feedback"]
DRIVE_NAMES = [f"drive.{name}" for name in Drive._fields]
SIGNAL_NAMES = [f"signals.{name}" for name in RobotSignals._fields]
UNITS |= dict(zip(DRIVE_NAMES, ("rad", "rad/s", "N m/rad", "N m s/rad"), strict=True))
UNITS |= {"signals.q": "rad", "signals.dq": "rad/s", "signals.attitude": "rad", "signals.gyroscope": "rad/s"}
UNITS |= {"signals.accelerometer": "m/s^2", "signals.tick": "samples"}

FLOAT = np.dtype(np.float64)


def _method(component: object, name: str) -> str:
    return f"{type(component).__name__}.{name}"


def _expected(name: str, shape: tuple[int, ...], unit: str) -> str:
    sides = "(3,)" if shape == (3,) else ["(L,)", "(L, J)", "(N, L, J)"][len(shape) - 1]
    size = "" if sides == str(shape) else f" = {shape}"
    return f"expected {sides}{size} float64, {unit}"


Target = tuple[str, Array, tuple[int, ...]]
"""What a component's output is copied to: its name, a key of UNITS, an array, and the shape of that.

To ask an array for its shape takes as long as half a copy of a few numbers.
"""


def make_targets(names: Iterable[str], arrays: Iterable[Array]) -> list[Target]:
    """Targets of outputs with these names, in the units of UNITS."""
    return [(name, array, array.shape) for name, array in zip(names, arrays, strict=True)]


def make_measurement_targets(state: Measurement) -> list[Target]:
    """Targets of a measurement; a travel that the loop does not have is checked all the same."""
    travel = np.empty(3) if state.travel is None else state.travel
    return make_targets((*STATE, "travel"), (*get_state(state), travel))


def copy_outputs(component: object, method: str, outputs: Iterable[Any], targets: Iterable[Target]) -> None:
    """Copy arrays that a component returned, the first ones if there are fewer targets; raises BadOutput."""
    for output, (name, array, shape) in zip(outputs, targets, strict=False):
        if getattr(output, "dtype", None) is FLOAT and output.shape == shape:
            array[...] = output
        else:
            array[...] = _convert(component, method, name, output, shape)


def _convert(component: object, method: str, name: str, output: Any, shape: tuple[int, ...]) -> Array:
    """Numbers of a ``shape`` that a component returned, in the unit of their name, as an array; raises BadOutput."""
    expected = _expected(name, shape, UNITS[name])
    try:
        values = np.asarray(output)
        kind = values.dtype.kind
    except (TypeError, ValueError):
        kind, values = "O", np.empty(0)
    if output is None or kind not in "fiub":
        raise BadOutput(f"{_method(component, method)} returned {name} of type {type(output).__name__}: {expected}")
    if values.shape != shape:
        raise BadOutput(f"{_method(component, method)} returned {name} of shape {values.shape}: {expected}")
    return values


def require_finite(component: object, method: str, name: str, values: Array) -> None:
    """Check that ``values``, of any shape and unit, are finite; raises BadOutput that names the first that is not."""
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        where = ", ".join(map(str, bad[0]))
        value = values[tuple(bad[0])]
        raise BadOutput(
            f"{_method(component, method)} returned {name}[{where}] = {value}: expected finite {UNITS[name]}"
        )


def copy_measurement(component: object, method: str, output: Any, targets: list[Target]) -> None:
    """Copy a measurement that a plant or sensors returned to the targets of one; raises BadOutput."""
    if not isinstance(output, Measurement):
        raise BadOutput(
            f"{_method(component, method)} returned {_describe(output)}: "
            f"expected cmacexp.plants.Measurement({', '.join(Measurement._fields)})"
        )
    has_travel = output.travel is not None
    copy_outputs(component, method, output, targets if has_travel else targets[:-1])
    if has_travel:
        require_finite(component, method, "travel", targets[-1][1])


def copy_action(component: object, output: Any, targets: list[Target]) -> bool:
    """Copy the action of a controller to the targets of feedback, feedforward and reference; raises BadOutput.

    Returns whether it contains the reference that the controller followed.
    """
    if not isinstance(output, Action):
        raise BadOutput(
            f"{_method(component, 'act')} returned {_describe(output)}: "
            "expected cmacexp.control.Action(feedback, feedforward[, reference])"
        )
    has_reference = output.reference is not None
    copy_outputs(component, "act", output, targets if has_reference else targets[:2])
    return has_reference


def copy_drive(component: object, drive: Any, targets: list[Target]) -> None:
    """Copy what a controller sends to drives beside its torques to its targets; raises BadOutput.

    None: torques alone, with gains of 0.
    """
    if drive is None:
        for _, array, _ in targets:
            array[...] = 0.0
        return
    if not isinstance(drive, Drive):
        raise BadOutput(
            f"{_method(component, 'act')} returned drive={_describe(drive)}: "
            f"expected cmacexp.control.Drive({', '.join(Drive._fields)}), or None"
        )
    copy_outputs(component, "act", drive, targets)
    for name, array, _ in targets:
        require_finite(component, "act", name, array)


def copy_signals(component: object, method: str, signals: Any, targets: list[Target]) -> None:
    """Copy what a plant says that a robot measures by itself to its targets; raises BadOutput."""
    if not isinstance(signals, RobotSignals):
        raise BadOutput(
            f"{_method(component, method)} returned signals={_describe(signals)}: "
            f"expected cmacexp.plants.RobotSignals({', '.join(RobotSignals._fields)})"
        )
    copy_outputs(component, method, signals, targets)


def _describe(output: Any) -> str:
    """The kind of a value, in a few words."""
    if isinstance(output, np.ndarray):
        return f"an array of shape {output.shape}"
    return "None" if output is None else f"a {type(output).__name__}"
