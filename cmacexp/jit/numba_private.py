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
from secrets import token_hex
from types import FunctionType, ModuleType
from typing import Any

import numba
from numba import types
from numba.core import codegen, event, serialize
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.registry import cpu_target
from numba.core.typed_passes import NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes, InlineInlinables
from numba.extending import typeof_impl

from cmacexp.jit.hooks import Hook
from cmacexp.jit.kernels import c_functions, inlined_kernels

njit: Any = numba.njit
make_function: Any = import_module("numba._dynfunc").make_function
config: Any = numba.config
Operation: Any = types.BaseFunction
infer_type: Any = Operation.get_call_type

DIGEST_BYTES = hashlib.sha256().digest_size
"""Size of the checksum before each compiled form."""
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
# What the first program that is compiled or read would do: here a process does it that others are copies of.
cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()


class _LinkedCode(codegen.JITCodeLibrary):
    """Code of a kernel, as programs link it: LLVM optimises and translates it there, with what surrounds it."""

    def finalize(self) -> None:
        """Link what the kernel calls."""
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):  # type: ignore[misc]
    """Makes the code of a program, or of a kernel, which has no entry for Python."""

    _name = "lowering_of_programs"

    def run_pass(self, state: Any) -> bool:
        """Lower the function of a ``state`` of the compiler."""
        is_kernel = state.flags.no_cpython_wrapper
        library = _LinkedCode if is_kernel else codegen.JITCodeLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        if not is_kernel:
            state.library.enable_object_caching()
            return bool(super().run_pass(state))
        state.flags.no_compile = True
        super().run_pass(state)
        made = state.cr
        entry = make_function(made.fndesc.lookup_module(), made.fndesc.qualname, "", 0, made.env, (state.library,))
        state.targetctx.insert_user_function(entry, made.fndesc, [state.library])
        state["cr"] = made._replace(cfunc=entry)
        return True


@cache
def _infer_type(operation: Any, context: Any, args: tuple[Any, ...], kws: tuple[Any, ...]) -> Any:
    """numba's signature of an operation on arguments of these types: one in all kernels, which share SETTINGS."""
    return infer_type(operation, context, args, dict(kws))


def _look_up_type(operation: Any, context: Any, args: Any, kws: Any) -> Any:
    """Stands in place of numba's method, which searches all templates for each statement, and again to lower it."""
    return _infer_type(operation, context, tuple(args), tuple(kws.items()))


class _Compiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler with this lowering."""

    def compile_extra(self, func: Callable[..., object]) -> Any:
        """Compile ``func``; only meanwhile are types looked up, since code of users has settings of its own."""
        before, Operation.get_call_type = Operation.get_call_type, _look_up_type
        try:
            return super().compile_extra(func)
        finally:
            Operation.get_call_type = before

    def define_pipelines(self) -> list[Any]:
        """The passes, without those that search each function for what kernels do not have."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.add_pass_after(_Lowering, NativeLowering)
        left_out = NativeLowering, NopythonRewrites, InlineClosureLikes, InlineInlinables
        manager.passes = [made for made in manager.passes if made[0] not in left_out]
        manager.finalize()
        return [manager]


@cache
def _inner(function: Callable[..., object]) -> Any:
    """A kernel as programs call it: not kept, since the programs that contain it are; without an entry for Python."""
    inline = inlined_kernels[function]
    return njit(**SETTINGS, no_cpython_wrapper=True, forceinline=inline, pipeline_class=_Compiler)(function)


@typeof_impl.register(FunctionType)
def _type_of_kernel(function: FunctionType, context: object) -> Any:
    """numba's type of a global function that compiled code calls; None of what is neither kernel nor C function."""
    if function in c_functions:
        *kinds, _ = function.__annotations__.values()
        arguments = [types.float64 if kind is float else types.intp for kind in kinds]
        return types.ExternalFunction(function.__name__, types.void(*arguments))
    return numba.typeof(_inner(function)) if function in inlined_kernels else None


def compiled_program(function: Callable[..., object], folder: Path) -> Callable[..., object]:
    """``function`` with an entry for Python, kept in ``folder``; as it is if compiling is switched off."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        compiled: Any = njit(**SETTINGS, cache=True, pipeline_class=_Compiler)(function)
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
        """Return the form for a key; None if there is none, or one that is not as it was saved."""
        with contextlib.suppress(Exception):  # of a file that a crash of the machine has emptied
            content = self._path(key).read_bytes()
            digest, form = content[:DIGEST_BYTES], content[DIGEST_BYTES:]
            if hashlib.sha256(form).digest() == digest:  # else machine code could end the process by a signal
                return pickle.loads(form)
        return None

    def save(self, key: object, form: object) -> None:
        """Write a form; a run does not need it on the disk, which may be full."""
        path, content = self._path(key), serialize.dumps(form)
        temporary = path.with_name(f"{path.name}.{token_hex(8)}.part")  # as no process of another machine names it
        with contextlib.suppress(OSError):
            try:
                temporary.write_bytes(hashlib.sha256(content).digest() + content)
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


@contextmanager
def before_compiling(
    call: Callable[[], None], again: Callable[[], None], note: Callable[[float], None]
) -> Iterator[None]:
    """Have ``call`` called before anything is compiled that the cache does not hold; what it raises prevents that.

    ``again`` is called many times meanwhile, and may end that likewise; ``note`` with the seconds that it took.
    """
    with (
        event.install_listener("numba:compile", _Listener(call)),
        event.install_listener("numba:run_pass", _Listener(again)),
        event.install_timer("numba:compile", note),
    ):
        yield
