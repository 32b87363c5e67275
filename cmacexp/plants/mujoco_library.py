"""MuJoCo's C library: functions that kernels call, and the variable that holds a function that it calls itself.

Compiled code finds the functions by their names in the process; plain Python calls them by way of ctypes. Both give
the bits of MuJoCo's Python functions.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.jit.kernels import c_function
from cmacexp.models.robot import load_mujoco
from cmacexp.typing import Counts

Callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
"""Of MuJoCo, with the addresses of a model and its data."""


@cache
def load_library() -> ctypes.CDLL:
    """The library of the installed package, whose functions compiled code finds from now on."""
    path = next(Path(load_mujoco().__file__).parent.glob("libmujoco.*"))
    return ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)


def _make_function(name: str) -> Callable[[int, int], None]:
    def call(model: int, data: int) -> None:
        getattr(load_library(), name)(ctypes.c_void_p(model), ctypes.c_void_p(data))

    call.__name__ = name
    return c_function(call)


mj_step, mj_step1, mj_step2, mj_kinematics, mj_comPos, mj_comVel = map(
    _make_function, ("mj_step", "mj_step1", "mj_step2", "mj_kinematics", "mj_comPos", "mj_comVel")
)
"""Functions of the addresses of a model and its data."""


def find_variable(name: str) -> Counts:
    """The variable of the library that holds the address of a function, (1,), a number; 0: none."""
    return np.ctypeslib.as_array((ctypes.c_int64 * 1).in_dll(load_library(), name))


def find_address(function: Any) -> int:
    """Where a C function made of a Python one is."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0
