"""Hooks: functions of Python that compiled code calls, with one integer.

Compiled code has no exceptions of Python. A hook returns a status instead, and keeps what its function raised until
:meth:`Hook.raise_error`.
"""

import ctypes
from collections.abc import Callable, Generator
from typing import Any

DONE, FAILED = range(2)
"""Statuses: the function returned, or raised."""

Numbered = Callable[[int], object]


def _answer(function: Numbered, errors: list[BaseException]) -> Generator[int, int, None]:
    """Call ``function`` with every number that is sent, and give the status; what it raises is added to ``errors``.

    A generator, since it resumes inside ``try``: a signal that arrives while compiled code runs is handled as soon as
    Python runs again, and what a handler raises outside ``try`` would be lost between Python and compiled code.
    """
    try:
        while True:
            number = yield DONE
            function(number)
    except GeneratorExit:  # nobody asks any more
        return
    except BaseException as error:
        errors.append(error)
    yield FAILED


class Hook:
    """A function that a program can call; it follows numba's ``WrapperAddressProtocol``."""

    def __init__(self, function: Numbered):
        self._errors: list[BaseException] = []
        answering = _answer(function, self._errors)
        next(answering)
        self._send = answering.send
        self._pointer = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(self._send)

    def __call__(self, number: int) -> int:
        """DONE, or FAILED, after which it must not be called again."""
        return self._send(number)

    def raise_error(self) -> None:
        """Raise what the function raised, if it did."""
        if self._errors:
            raise self._errors.pop()

    def __wrapper_address__(self) -> int | None:
        """Address of the function for compiled code.

        Without ``ctypes.cast``, by which the pointer would refer to itself: with a run that has ended, all that its
        hooks call would be kept until Python looks for garbage.
        """
        return ctypes.c_void_p.from_buffer(self._pointer).value

    def signature(self) -> Any:
        """numba's signature: from one integer to another."""
        from numba import types

        return types.int64(types.int64)
