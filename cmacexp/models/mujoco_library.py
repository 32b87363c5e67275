"""Functions of MuJoCo's C library that kernels call.

Compiled code finds them by their names in the process; plain Python calls them with ctypes. Both give the same bits
as MuJoCo's Python functions.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path

from cmacexp.jit.kernels import c_function
from cmacexp.models.robot import load_mujoco


@cache
def load_library() -> ctypes.CDLL:
    """Load the C library of the installed package; compiled code finds its functions from then on."""
    path = next(Path(load_mujoco().__file__).parent.glob("libmujoco.*"))
    library = ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    ctypes.c_void_p.in_dll(library, "mjcb_time").value = None  # MuJoCo's timers take a tenth of a step
    return library


def _make_function(name: str) -> Callable[[int, int], None]:
    def call(model: int, data: int) -> None:
        load_library()[name](ctypes.c_void_p(model), ctypes.c_void_p(data))

    call.__name__ = name
    return c_function(call)


mj_step1, mj_step2, mj_fwdAcceleration, mj_kinematics, mj_comPos = map(
    _make_function, ("mj_step1", "mj_step2", "mj_fwdAcceleration", "mj_kinematics", "mj_comPos")
)
"""Functions that take the addresses of a model and its data."""


@c_function
def mj_integratePos(model: int, position: int, velocity: int, time: float) -> None:
    """Integrate the position at one address by the velocity at another over ``time``, s."""
    load_library().mj_integratePos(*map(ctypes.c_void_p, (model, position, velocity)), ctypes.c_double(time))
