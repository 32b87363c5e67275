"""Kernels: plain Python functions that compiled programs take in, and functions of C libraries that they call."""

from collections.abc import Callable
from typing import TypeVar

Function = TypeVar("Function", bound=Callable[..., object])

inlined_kernels: dict[Callable[..., object], bool] = {}
"""Every kernel, and whether programs inline it."""
c_functions: set[Callable[..., object]] = set()
"""What calls a C function of its own name, which returns nothing: of floats and integers, which addresses are."""


def kernel(function: Function) -> Function:
    """A function that programs inline: passing tuples of arrays costs more than most kernels do.

    It works on arrays that its caller holds, and cannot make any.

    A kernel that takes something optional tests it for None itself: numba compiles nothing of a branch that an
    argument of the function excludes, but all of one that only a field of a tuple excludes.

    A kernel that takes most arrays of a loop takes what it needs of tuples before its first branch: a variable that
    other blocks read is stored, and each of them would read all of the tuple ("Compiling" in docs/performance.md).
    """
    inlined_kernels[function] = True
    return function


def called_kernel(function: Function) -> Function:
    """A kernel that programs call: a long function that many runs never need, and that would crowd its callers."""
    inlined_kernels[function] = False
    return function


def c_function(function: Function) -> Function:
    """A function of a C library: programs call it by its name, which must be that of ``function``.

    The library must have been loaded for the whole process, with ``RTLD_GLOBAL``.
    """
    c_functions.add(function)
    return function
