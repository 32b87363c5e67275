"""What parts give back to the loop, held to shape and kind: a mistake is told where it is made."""

from typing import Any

import numpy as np

from cmacexp.control.protocol import Action
from cmacexp.data.signals import list_units
from cmacexp.errors import BadOutput
from cmacexp.plants.protocol import STATE, Measurement, state_of
from cmacexp.typing import Array

UNITS = list_units()
UNITS["torque"] = UNITS["feedback"]

FLOAT = np.dtype(np.float64)


def _method(part: object, name: str) -> str:
    return f"{type(part).__name__}.{name}"


def _expected(name: str, shape: tuple[int, ...], unit: str) -> str:
    sides = "(3,)" if shape == (3,) else "(L, 2)" if len(shape) == 2 else "(L,)"
    size = "" if sides == str(shape) else f" = {shape}"
    return f"expected {sides}{size} float64, {unit}"


def take(part: object, method: str, name: str, given: Any, room: Array) -> None:
    """Copy an array that a part gave into ``room``, of the shape that it must have.

    Raises:
        BadOutput: it is no array of numbers of that shape.
    """
    try:
        if given.dtype is FLOAT and given.shape == room.shape:
            room[...] = given
            return
    except AttributeError:
        pass
    expected = _expected(name, room.shape, UNITS[name])
    try:
        values = np.asarray(given)
        kind = values.dtype.kind
    except (TypeError, ValueError):
        kind, values = "O", np.empty(0)
    if given is None or kind not in "fiub":
        raise BadOutput(f"{_method(part, method)} gave {name} of type {type(given).__name__}: {expected}")
    if values.shape != room.shape:
        raise BadOutput(f"{_method(part, method)} gave {name} of shape {values.shape}: {expected}")
    room[...] = values


def require_finite(part: object, method: str, name: str, values: Array) -> None:
    """Refuse values of which one is NaN or infinite.

    Raises:
        BadOutput: names the first of them.
    """
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        where = ", ".join(map(str, bad[0]))
        value = values[tuple(bad[0])]
        raise BadOutput(f"{_method(part, method)} gave {name}[{where}] = {value}: expected finite {UNITS[name]}")


def take_measurement(part: object, method: str, given: Any, room: Measurement) -> None:
    """Copy a measurement that plant or sensors gave into ``room``, the arrays of one.

    Raises:
        BadOutput: it is no :class:`Measurement`, or one of its arrays is not as it must be.
    """
    if not isinstance(given, Measurement):
        raise BadOutput(
            f"{_method(part, method)} gave {_told(given)}: "
            f"expected cmacexp.plants.Measurement({', '.join(Measurement._fields)})"
        )
    try:
        for values, own in zip(state_of(given), state_of(room), strict=True):
            if values.dtype is not FLOAT or values.shape != own.shape:
                break
            own[...] = values
        else:
            if given.travel is None:
                return
    except AttributeError:
        pass
    for name, values, own in zip(STATE, state_of(given), state_of(room), strict=True):
        take(part, method, name, values, own)
    if given.travel is not None:
        travel = np.empty(3)
        take(part, method, "travel", given.travel, travel)
        require_finite(part, method, "travel", travel)


def take_action(part: object, given: Any, feedback: Array, feedforward: Array, reference: Array) -> bool:
    """Copy what a controller gave into the loop's own arrays.

    Returns:
        Whether it said which reference it went by.

    Raises:
        BadOutput: it is no :class:`Action`, or one of its arrays is not as it must be.
    """
    if not isinstance(given, Action):
        raise BadOutput(
            f"{_method(part, 'act')} gave {_told(given)}: "
            "expected cmacexp.control.Action(feedback, feedforward[, reference])"
        )
    take(part, "act", "feedback", given[0], feedback)
    take(part, "act", "feedforward", given[1], feedforward)
    if given[2] is None:
        return False
    take(part, "act", "reference", given[2], reference)
    return True


def _told(given: Any) -> str:
    """What came instead, shortly."""
    if isinstance(given, np.ndarray):
        return f"an array of shape {given.shape}"
    return "None" if given is None else f"a {type(given).__name__}"
