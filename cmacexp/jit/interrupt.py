"""Handling of Ctrl-C, SIGTERM and SIGHUP: at once, or deferred while an operation must not be cut short."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from traceback import walk_tb

from cmacexp.errors import ComponentExit, describe_exit

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class _State:
    """Interrupt state of the main thread (Python handles signals only there)."""

    held_back = waiting = raised = False
    number = int(signal.SIGINT)
    """Number of the last signal."""


_state = _State()


def _handle(number: int, frame: object) -> None:
    """Raise ``KeyboardInterrupt``, or defer a first signal while interrupts are held back."""
    _state.number = number
    _state.waiting = _state.held_back and not _state.waiting
    if not _state.waiting:
        _state.raised = True
        raise KeyboardInterrupt


def raise_if_interrupted() -> None:
    """Raise an interrupt that has been held back; to be called at points where it is safe to stop."""
    if _state.waiting:
        _state.waiting = False
        raise KeyboardInterrupt


def is_interrupt(error: BaseException) -> bool:
    """Return True if ``error`` is an interrupt or follows one.

    Libraries turn interrupts into other errors, such as AttributeError.
    """
    return isinstance(error, KeyboardInterrupt) or _state.raised


def _comes_from_handler(error: SystemExit) -> bool:
    """Return True if a signal handler of the calling program raised ``error``, for example at SIGTERM."""
    handlers = {getattr(signal.getsignal(number), "__code__", None) for number in signal.valid_signals()}
    return any(frame.f_code in handlers for frame, _ in walk_tb(error.__traceback__))


@contextmanager
def exits_caught() -> Iterator[None]:
    """Convert a ``SystemExit`` of custom code to :class:`ComponentExit`, so that no component ends the program.

    A ``SystemExit`` raised by a signal handler of the program passes unchanged. One that a library raised because of
    an interrupt becomes ``KeyboardInterrupt``.
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
    """Return the exit code of an interrupted command: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP."""
    return 128 + _state.number


@contextmanager
def handled(signals: tuple[int, ...] = SIGNALS) -> Iterator[None]:
    """Raise ``KeyboardInterrupt`` at ``signals`` within the block.

    Signals that the process ignores (after ``nohup``) or handles itself are left as they are.
    """
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
    """Defer an interrupt to the end of the block, or to a call of :func:`raise_if_interrupted` in it.

    A second interrupt is raised at once.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = _state.held_back
    with handled((signal.SIGINT,)):  # in a notebook no command has installed a handler
        _state.held_back = True
        try:
            yield
        finally:
            _state.held_back = before
            if not before:
                raise_if_interrupted()


def interruptible(function: Callable[[int], object]) -> Callable[[int], object]:
    """Wrap ``function`` so that interrupts are raised at its start and while it runs, not held back.

    For functions of unknown duration. The wrapper must be called in the thread that made it; outside of the main
    thread, which gets no interrupts, ``function`` is returned unchanged.
    """
    if threading.current_thread() is not threading.main_thread():
        return function

    def call(number: int) -> None:
        before = _state.held_back
        _state.held_back = False
        try:
            raise_if_interrupted()
            function(number)
        finally:
            _state.held_back = before

    return call
