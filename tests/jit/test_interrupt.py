"""Ctrl-C, SIGTERM and SIGHUP: they wait where they would do harm, and are heeded once, at a safe place."""

import os
import signal
import sys

import pytest

from cmacexp.jit.interrupt import (
    exits_caught,
    handled,
    interrupt_held_back,
    interrupted_exit_code,
    interruptible,
    is_interrupt,
    raise_if_interrupted,
)


@pytest.fixture(autouse=True)
def heeds():
    """This process heeds interrupts, even if it was started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    with handled():  # and no later test finds it
        pass
    signal.signal(signal.SIGINT, before)


def press(number=signal.SIGINT):
    os.kill(os.getpid(), number)


def test_an_interrupt_waits_until_the_end_of_what_it_would_harm():
    done = []

    @interrupt_held_back()
    def work(inner):
        inner() if inner else press()
        done.append(inner)

    with pytest.raises(KeyboardInterrupt):
        work(lambda: work(None))
    assert len(done) == 2
    raise_if_interrupted()  # it is raised once
    with pytest.raises(KeyboardInterrupt):
        press()


def test_an_interrupt_that_waits_is_raised_at_a_safe_place_and_only_there():
    with interrupt_held_back():
        press()
        with pytest.raises(KeyboardInterrupt):
            raise_if_interrupted()
        raise_if_interrupted()
        press()
        with pytest.raises(KeyboardInterrupt):
            interruptible(lambda step: pytest.fail("is raised before"))(0)
        press()
        with pytest.raises(KeyboardInterrupt):
            press()  # a second one does not wait


def test_a_process_that_ignores_interrupts_goes_on_doing_so():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with handled(), interrupt_held_back():
        press()
        raise_if_interrupted()


def test_an_error_or_an_exit_that_a_library_makes_of_an_interrupt_is_one():
    with handled():
        with pytest.raises(KeyboardInterrupt):
            press()
        assert is_interrupt(AttributeError("half made"))
        with pytest.raises(KeyboardInterrupt), exits_caught():
            sys.exit(1)
    with handled():
        assert not is_interrupt(AttributeError("another"))


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_command_handles_signals_that_end_a_process(number, code):
    before, whatever_started_this = signal.default_int_handler, signal.getsignal(number)
    signal.signal(number, before)  # nohup ignores some, and what is ignored stays so
    with pytest.raises(KeyboardInterrupt), handled():
        press(number)
    assert interrupted_exit_code() == code
    assert signal.signal(number, whatever_started_this) is before
