"""Registries of kernels (Python functions that programs compile) and of functions of C libraries that they call."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., object])

kernels: list[tuple[Callable[..., object], bool]] = []
"""Kernels not yet registered with numba; True if programs inline the kernel."""
c_functions: list[Callable[..., object]] = []
"""Functions of C libraries not yet registered with numba."""

choices: list[tuple[Callable[..., Any], Mapping[type, Callable[..., Any]]]] = []
"""Dispatchers of :func:`by_type` not yet registered with numba, with their kernels by type of parameters."""


def by_type(cases: Mapping[type, Callable[..., Any]]) -> Callable[..., Any]:
    """Make a kernel that dispatches to one of ``cases`` by the type of its first argument.

    That argument is the struct of parameters of a component; programs resolve the choice when they are compiled.
    """

    def choose(params: object, *arguments: object) -> Any:
        return cases[type(params)](params, *arguments)

    choices.append((choose, cases))
    return choose


def kernel(function: Function) -> Function:
    """Register a function that programs compile inline and that Python calls uncompiled.

    A kernel works on arrays of its caller and cannot allocate any.

    A kernel with an optional argument tests it for None itself: numba omits a branch that an argument of the function
    excludes, but compiles one that only a field of a tuple excludes.

    A kernel that takes most arrays of a loop reads the fields that it needs from tuples before its first branch: a
    variable used in other blocks is stored, and each block would load the whole tuple.
    """
    kernels.append((function, True))
    return function


def called_kernel(function: Function) -> Function:
    """Register a kernel that programs call rather than inline: long code that many runs never need."""
    kernels.append((function, False))
    return function


def c_function(function: Function) -> Function:
    """Register a stub for the C function of the same name, which programs call.

    The C function returns void; its arguments are floats or integers (addresses). Its library must have been loaded
    for the whole process, with ``RTLD_GLOBAL``.
    """
    c_functions.append(function)
    return function
