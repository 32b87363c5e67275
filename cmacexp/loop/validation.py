"""Validation of the outputs of external components, in every step; errors name the component and the output."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from cmacexp.data.signals import list_array_units
from cmacexp.errors import BadOutput
from cmacexp.protocols import STATE, Action, Drive, Measurement, RobotSignals, get_state
from cmacexp.typing import Array

DRIVE_NAMES = [f"drive.{name}" for name in Drive._fields]
SIGNAL_NAMES = [f"signals.{name}" for name in RobotSignals._fields]
UNITS = {
    **list_array_units(),
    **dict.fromkeys(("torque", "learning_error"), "N m"),
    **dict(zip(DRIVE_NAMES, ("rad", "rad/s", "N m/rad", "N m s/rad"), strict=True)),
    **dict(zip(SIGNAL_NAMES, ("rad", "rad/s", "N m", "rad", "rad/s", "m/s^2", "samples"), strict=True)),
    "force_trusted": "",
}
"""Unit of each output, by name."""
EXPECTED = {
    Measurement: f"cmacexp.plants.Measurement({', '.join(Measurement._fields)})",
    RobotSignals: f"cmacexp.plants.RobotSignals({', '.join(RobotSignals._fields)})",
    Action: "cmacexp.control.Action(feedback, feedforward[, reference])",
    Drive: f"cmacexp.control.Drive({', '.join(Drive._fields)}), or None",
}
"""Descriptions of the tuples that components return, for error messages."""
OPTIONAL = ("reference", "travel")
"""Fields of these tuples that may be None; the target then keeps its values."""

FLOAT = np.dtype(np.float64)


def _method(component: object, name: str) -> str:
    return f"{type(component).__name__}.{name}"


Target = tuple[str, Array, tuple[int, ...]]
"""Target of an output: its name (a key of UNITS), an array of the loop, and the shape of that array.

The shape is stored, since reading it from an array takes half as long as copying a few numbers.
"""


def make_targets(names: Iterable[str], arrays: Iterable[Array]) -> list[Target]:
    """Make the targets of outputs with the given names, in the units of UNITS."""
    return [(name, array, array.shape) for name, array in zip(names, arrays, strict=True)]


def make_measurement_targets(state: Measurement) -> list[Target]:
    """Make the targets of a measurement; ``travel`` is checked even if ``state`` has none."""
    travel = np.empty(3) if state.travel is None else state.travel
    return make_targets((*STATE, "travel"), (*get_state(state), travel))


def copy_outputs(component: object, method: str, outputs: Iterable[Any], targets: Iterable[Target]) -> None:
    """Copy the arrays that ``method`` of a component returned to their targets; raises BadOutput.

    Outputs without a target, after the last one, are ignored.
    """
    for output, (name, array, shape) in zip(outputs, targets, strict=False):
        if isinstance(output, np.ndarray) and output.dtype is FLOAT and output.shape == shape:
            array[...] = output
        elif output is not None or name not in OPTIONAL:
            array[...] = _convert(component, method, name, output, shape)


def _convert(component: object, method: str, name: str, output: Any, shape: tuple[int, ...]) -> Array:
    """Convert an output of a component to an array of ``shape``; raises BadOutput if it is not one of numbers."""
    sides = "(3,)" if shape == (3,) else ["(L,)", "(L, J)", "(N, L, J)"][len(shape) - 1]
    size = "" if sides == str(shape) else f" = {shape}"
    expected = f"expected {sides}{size} float64, {UNITS[name]}"
    try:
        values = np.asarray(output)
    except (TypeError, ValueError):
        values = np.empty(0, dtype=object)
    if output is None or values.dtype.kind not in "fiub":
        raise BadOutput(f"{_method(component, method)} returned {name} of type {type(output).__name__}: {expected}")
    if values.shape != shape:
        raise BadOutput(f"{_method(component, method)} returned {name} of shape {values.shape}: {expected}")
    return values


def require_finite(component: object, method: str, name: str, values: Array) -> None:
    """Check that ``values``, of any shape and unit, are finite; raises BadOutput with the first that is not."""
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        where = ", ".join(map(str, bad[0]))
        value = values[tuple(bad[0])]
        raise BadOutput(
            f"{_method(component, method)} returned {name}[{where}] = {value}: expected finite {UNITS[name]}"
        )


def copy_parts(
    component: object,
    method: str,
    output: Any,
    kind: type[tuple[Any, ...]],
    targets: Iterable[Target],
    name: str = "",
) -> None:
    """Copy a tuple of type ``kind``, which a component returned, to its targets; raises BadOutput.

    ``name`` is the prefix in messages for a tuple that is a field of the returned one, such as ``drive=``.
    """
    if not isinstance(output, kind):
        description = "None" if output is None else f"a {type(output).__name__}"
        if isinstance(output, np.ndarray):
            description = f"an array of shape {output.shape}"
        raise BadOutput(f"{_method(component, method)} returned {name}{description}: expected {EXPECTED[kind]}")
    copy_outputs(component, method, output, targets)


def require_finite_state(component: object, method: str, measurement: Measurement) -> None:
    """Check that the state of a measurement is finite; raises BadOutput with the first value that is not."""
    for name, values in zip(STATE, get_state(measurement), strict=True):
        require_finite(component, method, name, values)


def copy_measurement(component: object, method: str, output: Any, targets: list[Target]) -> None:
    """Copy a measurement that a plant or sensors returned to its targets; raises BadOutput."""
    copy_parts(component, method, output, Measurement, targets)
    if output.travel is not None:
        require_finite(component, method, "travel", targets[-1][1])


def copy_drive(component: object, drive: Any, targets: list[Target]) -> None:
    """Copy the drive command of a controller to its targets; raises BadOutput.

    None means torques only, with gains of 0.
    """
    if drive is None:
        for _, array, _ in targets:
            array[...] = 0.0
        return
    copy_parts(component, "act", drive, Drive, targets, "drive=")
    for name, array, _ in targets:
        require_finite(component, "act", name, array)
