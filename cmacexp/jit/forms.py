"""Forms: programs compiled by numba for specific argument types, and their storage on disk.

Each form is stored in a separate folder, which is created by a single rename and never written to afterwards. In one
folder for all forms, processes would share numba's index: if two of them save at once, each can take the file name of
the other, and load its code.
"""

import contextlib
import hashlib
import inspect
import os
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import llvmlite.binding as llvm
import numba
import numba.experimental.function_type  # registers the type of hooks with numba
from numba import types
from numba.core import event
from numba.extending import overload, register_jitable

from cmacexp.jit.hooks import Hook
from cmacexp.jit.interrupt import raise_if_interrupted
from cmacexp.jit.kernels import c_functions, choices, kernels

DIGEST = "sha256"
"""Name of the file that holds the digest of the other files of its folder."""
# Counting references to the arrays in tuples would take longer than the arithmetic. Kernels cannot allocate arrays,
# so counting is not needed (_nrt). Programs are never called from C (no_cfunc_wrapper).
OPTIONS: Any = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}

njit: Any = numba.njit
config: Any = numba.config
types.WrapperAddressProtocol.register(Hook)


class Form:
    """A program compiled for arguments of the given ``types``; ``folder`` holds all forms of the program.

    The name of its subfolder is a hash of everything that numba compares before it accepts stored code (types,
    versions, processor, source file): numba would write into a folder whose code it rejects.
    """

    def __init__(self, function: Callable[..., object], types: tuple[Any, ...], folder: Path):
        self.function = function
        self.types = types
        source = os.stat(inspect.getfile(function))
        processor = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
        versions = numba.__version__, sys.implementation.cache_tag
        key = repr((types, versions, processor, source.st_mtime, source.st_size))
        self.folder = folder / hashlib.sha256(key.encode()).hexdigest()[:16]

    def load(self) -> Callable[..., object] | None:
        """Return the stored form; None if it is absent or its files do not match their digest.

        Corrupted machine code could crash the process.
        """
        return self._make(self.folder) if self._is_whole() else None

    def compile(self) -> Callable[..., object]:
        """Compile the form and store it if the disk permits; an interrupt ends compiling."""
        register_kernels()
        compiled = None
        with event.install_listener("numba:run_pass", _Interrupt()):
            with contextlib.suppress(OSError):
                self.folder.parent.mkdir(parents=True, exist_ok=True)
                with TemporaryDirectory(dir=self.folder.parent) as temporary:
                    new_folder = Path(temporary) / "form"
                    compiled = self._make(new_folder)
                    (new_folder / DIGEST).write_bytes(_digest(new_folder))
                    if not self._is_whole():
                        shutil.rmtree(self.folder, ignore_errors=True)
                    new_folder.rename(self.folder)  # fails if another process has been faster
            return compiled or njit(self.types, **OPTIONS)(self.function)

    def _make(self, folder: Path) -> Any:
        """Let numba read the form from ``folder``, or compile it and write it there."""
        before = config.CACHE_DIR
        config.CACHE_DIR = str(folder)
        try:
            return njit(self.types, cache=True, **OPTIONS)(self.function)
        finally:
            config.CACHE_DIR = before

    def _is_whole(self) -> bool:
        with contextlib.suppress(OSError):
            return (self.folder / DIGEST).read_bytes() == _digest(self.folder)
        return False


def find_types(arguments: Iterable[object]) -> tuple[Any, ...]:
    """Return the numba types of ``arguments``."""
    return tuple(map(numba.typeof, arguments))


def _digest(folder: Path) -> bytes:
    files = sorted(folder.rglob("*.nb?"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).digest()


def register_kernels() -> None:
    """Register all new kernels and C functions with numba, so that compiled code can call them."""
    while kernels:
        function, inlined = kernels.pop()
        register_jitable(**OPTIONS, forceinline=inlined)(function)
    while choices:
        _register_choice(*choices.pop())
    while c_functions:
        _register_c_function(c_functions.pop())


def _register_choice(function: Callable[..., object], cases: Mapping[type, Callable[..., object]]) -> None:
    @overload(function, jit_options=OPTIONS, strict=False)
    def find(params: Any, *_: object) -> Callable[..., object]:
        if isinstance(params, types.NoneType):  # numba compiles a branch that only a field of a tuple excludes
            return lambda params, *arguments: None
        case = cases[params.instance_class]
        return lambda params, *arguments: case(params, *arguments)


def _register_c_function(function: Callable[..., object]) -> None:
    *kinds, _ = function.__annotations__.values()
    arguments = [types.float64 if kind is float else types.intp for kind in kinds]
    call = types.ExternalFunction(function.__name__, types.void(*arguments))

    @overload(function, jit_options=OPTIONS, strict=False)
    def find(*_: object) -> Callable[..., None]:
        return lambda *arguments: call(*arguments)


class _Interrupt(event.Listener):
    """A listener that raises a pending interrupt between two passes of the compiler."""

    def on_start(self, event: event.Event) -> None:
        """Raise a pending interrupt before a compiler pass, which ends compiling."""
        raise_if_interrupted()

    def on_end(self, event: event.Event) -> None:
        """Do nothing after a compiler pass."""
