"""How kernels become machine code; all private names of numba stand here.

They are used with the versions of numba that ``pyproject.toml`` allows, which a test holds. Another version takes the
public way, which is slower and gives the same bits. Beside each name stands the row of ``docs/performance.md`` that
shows its gain.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
from numba.core import event
from numba.extending import typeof_impl

from cmacexp.jit.kernels import inlined_kernels

TESTED = ((0, 62), (0, 70))
"""First version of numba that these names were tested with, and first that they were not."""
KNOWN = TESTED[0] <= tuple(numba.version_info[:2]) < TESTED[1]

njit: Any = numba.njit
typeof: Any = numba.typeof
config: Any = numba.config
install_listener: Any = event.install_listener
register: Any = event.register

BLAS = ("scipy.linalg", "scipy.linalg.cython_blas")
PUBLIC_SETTINGS: dict[str, object] = {"error_model": "numpy"}
# "The loop, a step": counting references to the arrays inside tuples takes longer than the arithmetic; a kernel
# cannot make an array, so that none has to be counted. "Compiling": nothing calls programs from C.
SETTINGS = PUBLIC_SETTINGS | ({"_nrt": False, "no_cfunc_wrapper": True} if KNOWN else {})


def _import_without_blas() -> None:
    """Import what numba needs for arrays, but not scipy.linalg, which it imports only to know that it is installed.

    "Compiling", last row: 7 % of a whole command. Functions that use BLAS import it when they are compiled.
    """
    absent = [name for name in BLAS if name not in sys.modules] if KNOWN else []
    sys.modules.update({name: ModuleType(name) for name in absent})
    import_module("numba.np.arraymath")
    for name in absent:
        del sys.modules[name]


_import_without_blas()


@cache
def _inner(function: Callable[..., object]) -> Any:
    """A kernel as programs call it: not kept, since the programs that contain it are; without an entry for Python."""
    apart = {"no_cpython_wrapper": True, "forceinline": inlined_kernels[function]} if KNOWN else {}
    return njit(**SETTINGS, **apart)(function)


@typeof_impl.register(FunctionType)
def _type_of_kernel(function: FunctionType, context: object) -> Any:
    """numba's type of a global function that compiled code calls; None of what is no kernel."""
    return typeof(_inner(function)) if function in inlined_kernels else None


def compiled_program(function: Callable[..., object], folder: Path) -> Callable[..., object]:
    """``function`` with an entry for Python, kept in ``folder``; as it is if compiling is switched off."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        compiled: Callable[..., object] = njit(**SETTINGS, cache=True)(function)
    finally:
        config.CACHE_DIR = before
    _quick_compilation.programs.add(compiled)
    return compiled


class _Listener(event.Listener):
    def __init__(self, call: Callable[[], None]):
        self.call = call

    def on_start(self, event: event.Event) -> None:
        """A function is about to be compiled, which may be a kernel of the one that was called."""
        self.call()

    def on_end(self, event: event.Event) -> None:
        """A function has been compiled."""


class _QuickCompilation(event.Listener):
    """Lets LLVM optimise programs little; "Compiling": a quarter less, and the loop runs as fast."""

    def __init__(self) -> None:
        self.programs = set[object]()
        self.before = config.OPT

    def on_start(self, event: event.Event) -> None:
        """A program, a kernel in it, or a function of somebody else is about to be compiled."""
        if KNOWN and event.data["dispatcher"] in self.programs:
            self.before = config.OPT
            config.OPT = type(self.before)(1)

    def on_end(self, event: event.Event) -> None:
        """It has been compiled, or has failed."""
        if KNOWN and event.data["dispatcher"] in self.programs:
            config.OPT = self.before


_quick_compilation = _QuickCompilation()
register("numba:compile", _quick_compilation)


@contextmanager
def before_compiling(call: Callable[[], None]) -> Iterator[None]:
    """Have ``call`` called before anything is compiled that the cache does not hold; what it raises prevents that."""
    with install_listener("numba:compile", _Listener(call)):
        yield
