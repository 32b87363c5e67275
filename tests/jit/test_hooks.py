"""Hooks: what a function of Python raises passes compiled code, an interrupt and the error of a handler included."""

import os
import signal
import traceback
import weakref
from functools import partial

import pytest
from support.command import python

from cmacexp.jit.hooks import DONE, FAILED, Hook


def test_a_hook_gives_a_status_and_keeps_what_its_function_raised():
    def work(step):
        if step == 2:
            raise ValueError("mine")

    hook = Hook(work)
    assert [hook(step) for step in range(3)] == [DONE, DONE, FAILED]
    with pytest.raises(ValueError, match="mine") as raised:
        hook.raise_error()
    assert "work" in [frame.name for frame in traceback.extract_tb(raised.value.__traceback__)]
    hook.raise_error()  # it is raised once


def test_what_a_hook_calls_is_kept_no_longer_than_the_hook():
    hook = Hook(function := partial(int))
    kept = weakref.ref(function), hook.__wrapper_address__()
    del hook, function
    assert kept[0]() is None


def test_what_a_signal_handler_of_the_caller_raises_passes_too():
    def leave(number, frame):
        raise SystemExit(3)

    before, hook = signal.signal(signal.SIGTERM, leave), Hook(lambda step: os.kill(os.getpid(), signal.SIGTERM))
    assert hook(0) == FAILED
    signal.signal(signal.SIGTERM, before)
    with pytest.raises(SystemExit):
        hook.raise_error()


@pytest.mark.ci
def test_the_first_program_of_a_process_may_be_one_with_hooks(tmp_path):
    imports = "import cmacexp.jit.forms, numba\nfrom cmacexp.jit.hooks import Hook\n"
    code = imports + "print(numba.typeof(Hook(print)))"
    done = python("-c", code, folder=tmp_path)
    assert done.stdout == "FunctionType[int64(int64)]\n", done.stderr
