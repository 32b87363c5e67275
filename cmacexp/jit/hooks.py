"""Hooks: Python functions that compiled code calls with one integer argument.

Compiled code cannot handle Python exceptions. A hook returns a status instead and stores the exception that its
function raised until :meth:`Hook.raise_error`.
"""

import ctypes
from collections.abc import Callable, Generator
from typing import Any

DONE, FAILED = range(2)
"""Status of a call: the function returned, or raised an exception."""

Numbered = Callable[[int], object]


def _answer(function: Numbered, errors: list[BaseException]) -> Generator[int, int, None]:
    """Call ``function`` with every number sent, and yield the status of each call.

    An exception is appended to ``errors``. This is a generator because it resumes inside ``try``: the handler of a
    signal that arrives during compiled code runs as soon as Python does, and an exception that the handler raises
    outside ``try`` would be lost between Python and compiled code.
    """
    try:
        while True:
            number = yield DONE
            function(number)
    except GeneratorExit:  # the hook was deleted
        return
    except BaseException as error:
        errors.append(error)
    yield FAILED


class Hook:
    """A Python function that a program can call; it implements numba's ``WrapperAddressProtocol``."""

    def __init__(self, function: Numbered):
        self._errors: list[BaseException] = []
        answering = _answer(function, self._errors)
        next(answering)
        self._send = answering.send
        self._pointer = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(self._send)

    def __call__(self, number: int) -> int:
        """Call the function with ``number``; return DONE or FAILED, after which a hook must not be called again."""
        return self._send(number)

    def raise_error(self) -> None:
        """Raise the exception of the function, if it raised one."""
        if self._errors:
            raise self._errors.pop()

    def __wrapper_address__(self) -> int | None:
        """Return the address of the function for compiled code.

        ``ctypes.cast`` would make the pointer refer to itself: after the end of a run, everything that its hooks
        call would stay in memory until the next garbage collection.
        """
        return ctypes.c_void_p.from_buffer(self._pointer).value

    def signature(self) -> Any:
        """Return the numba signature: one integer argument, integer result."""
        from numba import types

        return types.int64(types.int64)
