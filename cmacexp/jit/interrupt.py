"""Ctrl-C: it ends what is going on at once, or waits where something must be done as a whole.

Python raises an interrupt between any two instructions. In the midst of an import, of compiling or of writing that
damages what is being made; in a function that a library calls back, Python prints the interrupt and drops it.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from cmacexp.jit.keyboard import Keyboard, handle

SOON = 0.01
"""Seconds until an interrupt is raised again that a function called by a library has dropped."""

CAN_BLOCK = hasattr(signal, "pthread_sigmask")


def raise_if_interrupted() -> None:
    """At a safe place, raise an interrupt that has been held back.

    Raises:
        KeyboardInterrupt: there was one.
    """
    if Keyboard.waits:
        Keyboard.waits = False
        raise KeyboardInterrupt


def _is_heeded() -> bool:
    """Whether an interrupt reaches this thread: the main one alone is interrupted, and a process may ignore it."""
    import threading

    is_main = threading.current_thread() is threading.main_thread()
    return is_main and signal.getsignal(signal.SIGINT) not in (signal.SIG_IGN, None)


def _interrupt_again() -> None:
    """Interrupt the main thread as the keyboard does."""
    if Keyboard.blocked:  # one that is sent to the thread itself would wait for ever
        os.kill(os.getpid(), signal.SIGINT)
    elif hasattr(signal, "pthread_kill"):
        import threading

        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)


@contextmanager
def interrupt_held_back() -> Iterator[None]:
    """Hold back an interrupt until the end, or until :func:`raise_if_interrupted`; a second one is raised at once."""
    if not _is_heeded():
        yield
        return
    handler, held = signal.getsignal(signal.SIGINT), Keyboard.holds
    Keyboard.holds, Keyboard.waits = True, held and Keyboard.waits
    signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        Keyboard.holds = held
        if Keyboard.waits and not held:
            Keyboard.waits = False
            _interrupt_again()


@contextmanager
def interrupt_let_through() -> Iterator[None]:
    """Raise an interrupt at once, also inside :func:`interrupt_held_back`: around code that may take any time."""
    held = Keyboard.holds
    if not (held and _is_heeded()):
        yield
        return
    Keyboard.holds = False
    try:
        raise_if_interrupted()
        yield
    finally:
        Keyboard.holds = held


def _start_tracker() -> None:
    """Start what Python starts before its first process of :mod:`multiprocessing`, and then unblocks interrupts."""
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()


@contextmanager
def interrupt_blocked() -> Iterator[None]:
    """Have processes that begin meanwhile inherit that they are not interrupted; this one is afterwards."""
    if not CAN_BLOCK:
        yield
        return
    _start_tracker()
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])


def block_interrupts_of_children() -> None:
    """Have all processes that this one begins from now on inherit that they are not interrupted; this one still is.

    The main thread and those that it starts block interrupts, one other thread lets them through to Python, which
    raises them in the main thread.
    """
    if CAN_BLOCK and _is_heeded():
        import threading

        _start_tracker()
        threading.Thread(target=threading.Event().wait, daemon=True).start()
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        Keyboard.blocked = True


@contextmanager
def interrupt_unblocked() -> Iterator[None]:
    """Heed interrupts in a process that began without, also one that has come since.

    Raises:
        KeyboardInterrupt: there was one.
    """
    if not CAN_BLOCK:
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])  # raises one that has come
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


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


def heed_interrupts() -> None:
    """Raise interrupts from now on, also the one that has come since :func:`cmacexp.jit.keyboard.begin_command`.

    Raises:
        KeyboardInterrupt: there was one.
    """
    if Keyboard.is_command:
        Keyboard.holds = False
        if hasattr(signal, "pthread_kill"):
            sys.unraisablehook = _raise_again
        raise_if_interrupted()


def _raise_again(dropped: Any) -> None:
    """Raise an interrupt again that Python can only print and drop."""
    if isinstance(dropped.exc_value, KeyboardInterrupt):
        import threading

        threading.Timer(SOON, _interrupt_again).start()
    else:
        sys.__unraisablehook__(dropped)


def end_command() -> None:
    """Ignore interrupts while a command, which has done its work, leaves Python."""
    if Keyboard.is_command:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        exec("")  # else Python, after an interrupt in code that a library executed as text, kills itself by a signal
