"""Kernels: plain Python functions that compiled programs take in, and functions of C libraries that they call."""

from collections.abc import Callable
from functools import partial
from typing import TypeVar, overload

Function = TypeVar("Function", bound=Callable[..., object])

inlined_kernels: dict[Callable[..., object], bool] = {}
"""Every kernel, and whether programs inline it."""
c_functions: set[Callable[..., object]] = set()
"""What calls a C function of its own name, which returns nothing: of floats and integers, which addresses are."""


@overload
def kernel(function: Function) -> Function: ...


@overload
def kernel(*, inline: bool) -> Callable[[Function], Function]: ...


def kernel(function: Function | None = None, *, inline: bool = True) -> Function | Callable[[Function], Function]:
    """A function that programs inline: passing tuples of arrays costs more than most kernels do.

    It works on arrays that its caller holds, and cannot make any. ``inline=False`` is for a long function that many
    runs never call, and that would crowd its callers.

    A kernel that takes something optional tests it for None itself: numba compiles nothing of a branch that an
    argument of the function excludes, but all of one that only a field of a tuple excludes.

    A kernel that takes most arrays of a loop takes what it needs of tuples before its first branch: a variable that
    other blocks read is stored, and each of them would read all of the tuple ("Compiling" in docs/performance.md).
    """
    if function is None:
        return partial(kernel, inline=inline)
    inlined_kernels[function] = inline
    return function


def c_function(function: Function) -> Function:
    """A function of a C library: programs call it by its name, which must be that of ``function``.

    The library must have been loaded for the whole process, with ``RTLD_GLOBAL``.
    """
    c_functions.add(function)
    return function
