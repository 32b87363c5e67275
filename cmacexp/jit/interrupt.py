"""Ctrl-C, SIGTERM and SIGHUP: they end what is going on at once, or wait where something must be done as a whole."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from traceback import walk_tb

from cmacexp.errors import ComponentExit, describe_exit

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class _State:
    """What is known of the main thread, which alone is interrupted."""

    held_back = waiting = raised = False
    number = int(signal.SIGINT)
    """Number of the last signal."""


_state = _State()


def _handle(number: int, frame: object) -> None:
    """Note a signal that has to wait; a second one does not."""
    _state.number, was_waiting = number, _state.waiting
    _state.waiting = _state.held_back and not was_waiting
    if not _state.waiting:
        _state.raised = True
        raise KeyboardInterrupt


def raise_if_interrupted() -> None:
    """At a safe place, raise an interrupt that has been held back."""
    if _state.waiting:
        _state.waiting = False
        raise KeyboardInterrupt


def is_interrupt(error: BaseException) -> bool:
    """Whether an error is an interrupt, or comes after one, of which libraries make errors such as AttributeError."""
    return isinstance(error, KeyboardInterrupt) or _state.raised


def _comes_from_handler(error: SystemExit) -> bool:
    """Whether a signal handler of the caller's program raised it, as one that calls ``sys.exit`` at SIGTERM."""
    handlers = {getattr(signal.getsignal(number), "__code__", None) for number in signal.valid_signals()}
    return any(frame.f_code in handlers for frame, _ in walk_tb(error.__traceback__))


@contextmanager
def exits_caught() -> Iterator[None]:
    """Raise a ``SystemExit`` of custom code as :class:`ComponentExit`: no component ends the program that runs it.

    One that a signal handler of the program raises passes; one that a library has made of an interrupt is raised as
    the interrupt.
    """
    try:
        yield
    except SystemExit as error:
        if _comes_from_handler(error):
            raise
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        raise ComponentExit(describe_exit(error)).with_traceback(error.__traceback__) from None


def interrupted_exit_code() -> int:
    """The exit code of a command that was interrupted: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP."""
    return 128 + _state.number


@contextmanager
def handled(signals: tuple[int, ...] = SIGNALS) -> Iterator[None]:
    """Raise ``KeyboardInterrupt`` at signals, except those that this process ignores as after ``nohup``."""
    defaults = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in signals if signal.getsignal(number) in defaults}
    _state.raised = _state.raised and not before
    try:
        for number in before:
            signal.signal(number, _handle)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def interrupt_held_back() -> Iterator[None]:
    """Hold back an interrupt until the end, or until :func:`raise_if_interrupted`; a second one is raised at once."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = _state.held_back
    with handled((signal.SIGINT,)):  # in a notebook, where no command handles it
        _state.held_back = True
        try:
            yield
        finally:
            _state.held_back = before
            if not before:
                raise_if_interrupted()


def interruptible(function: Callable[[int], object]) -> Callable[[int], object]:
    """``function``, which may take any time: an interrupt is not held back at its start and in it.

    It must be called in the thread that asks for it; only the main thread is interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        return function

    def call(number: int) -> None:
        before, _state.held_back = _state.held_back, False
        try:
            raise_if_interrupted()
            function(number)
        finally:
            _state.held_back = before

    return call
