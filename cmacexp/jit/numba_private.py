"""How kernels become machine code; all private names of numba stand here.

``pyproject.toml`` allows only versions of numba that have them. Beside each name stands the row of
``docs/performance.md`` that shows its gain.
"""

import contextlib
import fcntl
import hashlib
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
from numba import types
from numba.core import event, serialize
from numba.extending import typeof_impl

from cmacexp.jit.kernels import c_functions, inlined_kernels

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

    "Compiling", last row: 7 % of a whole command. Functions that use BLAS import it when they are compiled.
    """
    absent = [name for name in BLAS if name not in sys.modules]
    sys.modules.update({name: ModuleType(name) for name in absent})
    import_module("numba.np.arraymath")
    for name in absent:
        del sys.modules[name]


_import_without_blas()


@cache
def _inner(function: Callable[..., object]) -> Any:
    """A kernel as programs call it: not kept, since the programs that contain it are; without an entry for Python."""
    return njit(**SETTINGS, no_cpython_wrapper=True, forceinline=inlined_kernels[function])(function)


@typeof_impl.register(FunctionType)
def _type_of_kernel(function: FunctionType, context: object) -> Any:
    """numba's type of a global function that compiled code calls; None of what is neither kernel nor C function."""
    if function in c_functions:
        arguments = [types.intp] * function.__code__.co_argcount
        return types.ExternalFunction(function.__name__, types.void(*arguments))
    return typeof(_inner(function)) if function in inlined_kernels else None


def compiled_program(function: Callable[..., object], folder: Path) -> Callable[..., object]:
    """``function`` with an entry for Python, kept in ``folder``; as it is if compiling is switched off."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        compiled: Any = njit(**SETTINGS, cache=True)(function)
    finally:
        config.CACHE_DIR = before
    if compiled is not function:
        compiled._cache._cache_file = CheckedFiles(compiled._cache._cache_file)
    return compiled  # type: ignore[no-any-return]


_locks: list[ExitStack] = []
"""What holds the locks of forms that are being made; empty if nobody is to wait for them."""


class CheckedFiles:
    """Compiled forms of one function, a file each, instead of numba's own files, which it reads without a check.

    They are pickles: a truncated one raises whatever it likes, and a wrong bit in machine code can crash the process.
    A file is the SHA-256 of the rest, then the pickled form and what it belongs to.
    """

    def __init__(self, numbas: Any):
        self.folder, self.name = Path(numbas._cache_path), numbas._index_name.removesuffix(".nbi")
        self.state = (numba.__version__, numbas._source_stamp)

    def _path(self, key: object) -> Path:
        return self.folder / f"{self.name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"

    def load(self, key: object) -> object:
        """The form for a key, which names types and processor; None if there is none that can be used."""
        path = self._path(key)
        if not path.exists() and _locks:
            with contextlib.suppress(OSError):  # of a file system without locks
                lock = _locks[-1].enter_context(path.with_suffix(".lock").open("w"))
                fcntl.flock(lock, fcntl.LOCK_EX)  # another process that makes this form now has it for us then
        try:
            content = path.read_bytes()
        except OSError:
            return None
        digest, pickled = content[:32], content[32:]
        if hashlib.sha256(pickled).digest() != digest:
            print(f"{path}: compiled code was damaged; it is removed and made again when needed", file=sys.stderr)
            with contextlib.suppress(OSError):
                path.unlink()
            return None
        state, stored_key, form = pickle.loads(pickled)
        return form if (state, stored_key) == (self.state, key) else None

    def save(self, key: object, form: object) -> None:
        """Write a form, so that its file is whole or absent; a run does not need it on the disk."""
        path = self._path(key)
        temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
        pickled = dumps((self.state, key, form))
        with contextlib.suppress(OSError):
            try:
                temporary.write_bytes(hashlib.sha256(pickled).digest() + pickled)
                os.replace(temporary, path)
            finally:
                temporary.unlink(missing_ok=True)


class _Listener(event.Listener):
    def __init__(self, call: Callable[[], None]):
        self.call = call

    def on_start(self, event: event.Event) -> None:
        """A function is about to be compiled, which may be a kernel of the one that was called."""
        self.call()

    def on_end(self, event: event.Event) -> None:
        """A function has been compiled."""


@contextmanager
def before_compiling(call: Callable[[], None], again: Callable[[], None], waits: bool) -> Iterator[None]:
    """Have ``call`` called before anything is compiled that the cache does not hold; what it raises prevents that.

    ``again`` is called many times meanwhile, and may end that likewise. With ``waits`` another process that compiles
    the same is waited for; else both do. LLVM optimises little; "Compiling": a quarter less, the loop runs as fast.
    """
    before = config.OPT
    with ExitStack() as held:
        held.enter_context(install_listener("numba:compile", _Listener(call)))
        held.enter_context(install_listener("numba:run_pass", _Listener(again)))
        held.callback(_locks.clear)
        held.callback(setattr, config, "OPT", before)
        config.OPT = type(before)(1)
        _locks[:] = [held] if waits else []
        yield
