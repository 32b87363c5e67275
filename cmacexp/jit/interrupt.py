"""Ctrl-C: it ends what is going on at once, or waits where something must be done as a whole.

Python raises an interrupt between any two instructions. In the midst of an import, of compiling or of writing that
damages what is being made; in a function that a library calls back, Python prints the interrupt and drops it.
"""

import os.path
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# No other module is imported here: until begin_command an interrupt ends a command with a stack trace.

SOON = 0.01
"""Seconds until an interrupt is raised again that a function called by a library has dropped."""
COMMANDS = ("cmacexp", "pipelines")
"""Packages whose modules are commands, and the name of the script."""


class _Keyboard:
    """Interrupts of this process."""

    holds = False
    """Whether an interrupt waits."""
    waits = False
    """Whether one does."""
    is_command = False


def _handle(number: int, frame: FrameType | None) -> None:
    """Note an interrupt that has to wait; a second one does not."""
    if _Keyboard.holds and not _Keyboard.waits:
        _Keyboard.waits = True
        return
    _Keyboard.waits = False
    raise KeyboardInterrupt


def raise_if_interrupted() -> None:
    """At a safe place, raise an interrupt that has been held back.

    Raises:
        KeyboardInterrupt: there was one.
    """
    if _Keyboard.waits:
        _Keyboard.waits = False
        raise KeyboardInterrupt


def _is_heeded() -> bool:
    """Whether an interrupt reaches this thread: the main one alone is interrupted, and a process may ignore it."""
    import threading

    is_main = threading.current_thread() is threading.main_thread()
    return is_main and signal.getsignal(signal.SIGINT) not in (signal.SIG_IGN, None)


@contextmanager
def interrupt_held_back() -> Iterator[None]:
    """Hold back an interrupt until the end, or until :func:`raise_if_interrupted`; a second one is raised at once."""
    if not _is_heeded():
        yield
        return
    handler, held = signal.getsignal(signal.SIGINT), _Keyboard.holds
    _Keyboard.holds, _Keyboard.waits = True, held and _Keyboard.waits
    signal.signal(signal.SIGINT, _handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        _Keyboard.holds = held
        if _Keyboard.waits and not held:
            _Keyboard.waits = False
            signal.raise_signal(signal.SIGINT)


@contextmanager
def interrupt_let_through() -> Iterator[None]:
    """Raise an interrupt at once, also inside :func:`interrupt_held_back`: around code that may take any time."""
    held = _Keyboard.holds
    if not (held and _is_heeded()):
        yield
        return
    _Keyboard.holds = False
    try:
        raise_if_interrupted()
        yield
    finally:
        _Keyboard.holds = held


@contextmanager
def interrupt_blocked() -> Iterator[None]:
    """Have processes that begin meanwhile inherit that they are not interrupted; this one is afterwards."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])


@contextmanager
def interrupt_as_such() -> Iterator[None]:
    """Raise an interrupt as such where a library has made another error of it.

    Raises:
        KeyboardInterrupt: an error was raised while one was handled.
    """
    try:
        yield
    except Exception as error:
        before: BaseException | None = error
        while before is not None:
            if isinstance(before, KeyboardInterrupt):
                raise KeyboardInterrupt from error
            before = before.__context__
        raise


def _name_command() -> str:
    """The module that Python runs, or the name of its script."""
    if sys.argv[:1] == ["-m"]:  # Python imports the packages of the module that follows
        return sys.orig_argv[sys.orig_argv.index("-m") + 1]
    main = sys.modules["__main__"]
    spec, file = getattr(main, "__spec__", None), getattr(main, "__file__", None)
    return str(spec.name) if spec is not None else os.path.basename(file or "")


def begin_command() -> None:
    """Hold back interrupts while a command imports its modules, until :func:`heed_interrupts`; else do nothing."""
    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_default and _name_command().partition(".")[0] in COMMANDS:
        signal.signal(signal.SIGINT, _handle)
        _Keyboard.holds = _Keyboard.is_command = True


def heed_interrupts() -> None:
    """Raise interrupts from now on, also the one that has come since :func:`begin_command`.

    Raises:
        KeyboardInterrupt: there was one.
    """
    if _Keyboard.is_command:
        _Keyboard.holds = False
        if hasattr(signal, "pthread_kill"):
            sys.unraisablehook = _raise_again
        raise_if_interrupted()


def _raise_again(dropped: Any) -> None:
    """Raise an interrupt again that Python can only print and drop."""
    if isinstance(dropped.exc_value, KeyboardInterrupt):
        import threading

        threading.Timer(SOON, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT)).start()
    else:
        sys.__unraisablehook__(dropped)


def end_command() -> None:
    """Ignore interrupts while a command, which has done its work, leaves Python."""
    if _Keyboard.is_command:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        exec("")  # else Python, after an interrupt in code that a library executed as text, kills itself by a signal
