"""Kernels: plain Python functions that compiled programs take in, and functions of C libraries that they call."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., object])

kernels: list[tuple[Callable[..., object], bool]] = []
"""Kernels that numba does not know yet, and whether programs inline them."""
c_functions: list[Callable[..., object]] = []
"""Functions of C libraries that numba does not know yet."""

choices: list[tuple[Callable[..., Any], Mapping[type, Callable[..., Any]]]] = []
"""Functions that are chosen by type, as numba does not know them yet, and the kernels by types of parameters."""


def by_type(cases: Mapping[type, Callable[..., Any]]) -> Callable[..., Any]:
    """Make a kernel that is one of ``cases``, by the type of its first argument: the parameters of a component."""

    def choose(params: object, *arguments: object) -> Any:
        return cases[type(params)](params, *arguments)

    choices.append((choose, cases))
    return choose


def kernel(function: Function) -> Function:
    """A function that programs call, and that Python calls as it stands.

    It works on arrays that its caller holds, and cannot make any.

    A kernel that takes something optional tests it for None itself: numba compiles nothing of a branch that an
    argument of the function excludes, but all of one that only a field of a tuple excludes.

    A kernel that takes most arrays of a loop takes what it needs of tuples before its first branch: a variable that
    other blocks read is stored, and each of them would read all of the tuple ("Compiling" in docs/performance.md).
    """
    kernels.append((function, True))
    return function


def called_kernel(function: Function) -> Function:
    """A kernel that programs call: a long function that many runs never need, and that would crowd its callers."""
    kernels.append((function, False))
    return function


def c_function(function: Function) -> Function:
    """A function of a C library: programs call it by its name, which must be that of ``function``.

    It returns nothing, and takes floats and integers, which addresses are. The library must have been loaded for the
    whole process, with ``RTLD_GLOBAL``.
    """
    c_functions.append(function)
    return function
