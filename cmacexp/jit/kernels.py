"""Kernels: plain Python functions that compiled programs take in, and functions of C libraries that they call."""

from collections.abc import Callable
from typing import TypeVar

Function = TypeVar("Function", bound=Callable[..., object])

inlined_kernels: dict[Callable[..., object], bool] = {}
"""Every kernel, and whether programs inline it."""
c_functions: set[Callable[..., object]] = set()
"""What calls a C function of its own name, whose arguments are integers or addresses, and which returns nothing."""


def kernel(function: Function) -> Function:
    """A function that programs inline: passing tuples of arrays costs more than most kernels do.

    It works on arrays that its caller holds, and cannot make any.
    """
    inlined_kernels[function] = True
    return function


def kernel_apart(function: Function) -> Function:
    """:func:`kernel` for a long function that many runs never call, and that would crowd its callers."""
    inlined_kernels[function] = False
    return function


def c_function(function: Function) -> Function:
    """A function of a C library: programs call it by its name, which must be that of ``function``.

    The library must have been loaded for the whole process, with ``RTLD_GLOBAL``.
    """
    c_functions.add(function)
    return function
