"""How kernels become machine code; all private names of numba stand here.

``pyproject.toml`` allows only versions of numba that have them. "Compiling" in ``docs/performance.md`` shows
what they gain.
"""

import contextlib
import hashlib
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
from numba import types
from numba.core import event, serialize
from numba.extending import typeof_impl

from cmacexp.jit.hooks import Hook
from cmacexp.jit.kernels import c_functions, inlined_kernels, merged_kernels

njit: Any = numba.njit
typeof: Any = numba.typeof
config: Any = numba.config
install_listener: Any = event.install_listener
dumps: Any = serialize.dumps

BLAS = ("scipy.linalg", "scipy.linalg.cython_blas")
# "The loop, a step": counting references to the arrays inside tuples takes longer than the arithmetic; a kernel
# cannot make an array, so that none has to be counted. "Compiling": nothing calls programs from C.
SETTINGS: dict[str, object] = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}


def _import_without_blas() -> None:
    """Import what numba needs for arrays, but not scipy.linalg, which it imports only to know that it is installed.

    That is 7 % of a whole command. Functions that use BLAS import it when they are compiled.
    """
    absent = [name for name in BLAS if name not in sys.modules]
    sys.modules.update({name: ModuleType(name) for name in absent})
    import_module("numba.np.arraymath")
    for name in absent:
        del sys.modules[name]


_import_without_blas()
import_module("numba.experimental.function_type")  # which knows the type of a hook; numba itself imports it late
types.WrapperAddressProtocol.register(Hook)


@cache
def _inner(function: Callable[..., object]) -> Any:
    """A kernel as programs call it: not kept, since the programs that contain it are; without an entry for Python."""
    return njit(**SETTINGS, no_cpython_wrapper=True, forceinline=inlined_kernels[function])(function)


@typeof_impl.register(FunctionType)
def _type_of_kernel(function: FunctionType, context: object) -> Any:
    """numba's type of a global function that compiled code calls; None of what is neither kernel nor C function."""
    if function in c_functions:
        *kinds, _ = function.__annotations__.values()
        arguments = [types.float64 if kind is float else types.intp for kind in kinds]
        return types.ExternalFunction(function.__name__, types.void(*arguments))
    return typeof(_inner(function)) if function in inlined_kernels else None


def compiled_program(function: Callable[..., object], folder: Path) -> Callable[..., object]:
    """``function`` with an entry for Python, kept in ``folder``; as it is if compiling is switched off."""
    for merged in merged_kernels:  # numba takes what has these two attributes for a function of its own
        vars(merged).update(py_func=merged, targetoptions={"inline": "always"})
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        compiled: Any = njit(**SETTINGS, cache=True)(function)
    finally:
        config.CACHE_DIR = before
    if compiled is not function:
        compiled._cache._cache_file = FormFiles(Path(compiled._cache.cache_path), compiled._cache._impl.filename_base)
    return compiled  # type: ignore[no-any-return]


class FormFiles:
    """Compiled forms of one function, a file each, which is whole or absent.

    numba's own files share an index: of two processes that save forms for other types at once, each can take the
    name of the other's file, and then load its code.
    """

    def __init__(self, folder: Path, name: str):
        self.folder, self.name = folder, name

    def _path(self, key: object) -> Path:
        """The file of a form; its ``key`` names types and processor."""
        digest = hashlib.sha256(repr((numba.__version__, key)).encode()).hexdigest()
        return self.folder / f"{self.name}.{digest[:16]}.nbc"

    def load(self, key: object) -> object:
        """The form for a key; None if there is none that can be read."""
        with contextlib.suppress(Exception):  # of a file that a crash of the machine has emptied
            return pickle.loads(self._path(key).read_bytes())
        return None

    def save(self, key: object, form: object) -> None:
        """Write a form; a run does not need it on the disk, which may be full."""
        path = self._path(key)
        temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
        with contextlib.suppress(OSError):
            try:
                temporary.write_bytes(dumps(form))
                os.replace(temporary, path)
            finally:
                temporary.unlink(missing_ok=True)


class _Listener(event.Listener):
    def __init__(self, call: Callable[[], None]):
        self.call = call

    def on_start(self, event: event.Event) -> None:
        """What this listens to begins."""
        self.call()

    def on_end(self, event: event.Event) -> None:
        """What this listens to has ended."""


class _Compiling(_Listener):
    """Has LLVM optimise programs, and the kernels inside them little, since it sees them again in the program."""

    def __init__(self, call: Callable[[], None]):
        super().__init__(call)
        self.level, self.depth = type(config.OPT), 0

    def on_start(self, event: event.Event) -> None:
        """A program is about to be compiled, or a kernel inside it."""
        self.call()
        self._enter(1)

    def on_end(self, event: event.Event) -> None:
        """It has been compiled."""
        self._enter(-1)

    def _enter(self, depth: int) -> None:
        self.depth += depth
        config.OPT = self.level(1 if self.depth > 1 else 3)


@contextmanager
def before_compiling(call: Callable[[], None], again: Callable[[], None]) -> Iterator[None]:
    """Have ``call`` called before anything is compiled that the cache does not hold; what it raises prevents that.

    ``again`` is called many times meanwhile, and may end that likewise.
    """
    before = config.OPT
    with install_listener("numba:compile", _Compiling(call)), install_listener("numba:run_pass", _Listener(again)):
        try:
            yield
        finally:
            config.OPT = before
