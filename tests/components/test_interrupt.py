"""Ctrl-C: it waits where it would do harm, is never lost, and all steps that were taken are kept."""

import ast
import json
import os
import signal
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from support.command import python

import cmacexp
from cmacexp.experiment import run as experiment
from cmacexp.experiment.run import run_scenario
from cmacexp.jit import interrupt, keyboard
from cmacexp.jit.interrupt import (
    interrupt_as_such,
    interrupt_held_back,
    interrupt_let_through,
    interrupt_unblocked,
    raise_if_interrupted,
)
from cmacexp.loop import compiled, roll_out
from cmacexp.loop.scenario import make_scenario

SHORT = ("cycles=2", "gait.cycle_time=0.5", "gait.stroke=0.02", "learning.start_cycle=1")


@pytest.fixture(autouse=True)
def heeds():
    """This process heeds interrupts, even if it was started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def press():
    os.kill(os.getpid(), signal.SIGINT)


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
        with pytest.raises(KeyboardInterrupt), interrupt_let_through():
            pytest.fail("is raised before")
        with pytest.raises(KeyboardInterrupt), interrupt_let_through():
            press()


def test_a_second_interrupt_does_not_wait():
    with interrupt_held_back():
        press()
        with pytest.raises(KeyboardInterrupt):
            press()


def test_a_process_that_ignores_interrupts_goes_on_doing_so():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interrupt_held_back():
        press()
        raise_if_interrupted()


def test_an_interrupt_that_a_library_drops_is_raised_again():
    interrupt._raise_again(SimpleNamespace(exc_value=KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        time.sleep(10.0)


def test_an_error_that_a_library_makes_of_an_interrupt_is_one():
    @interrupt_as_such()
    def compose():
        try:
            raise KeyboardInterrupt
        finally:
            raise AttributeError("half made")

    with pytest.raises(KeyboardInterrupt):
        compose()
    with pytest.raises(AttributeError), interrupt_as_such():
        raise AttributeError("of another cause")


def test_the_package_holds_back_interrupts_before_it_imports_anything_else():
    first, second = ast.parse(Path(cmacexp.__file__).read_text()).body[1:3]
    assert (ast.unparse(first), ast.unparse(second)) == (
        "from cmacexp.jit.keyboard import begin_command",
        "begin_command()",
    )
    top = ast.parse(Path(keyboard.__file__).read_text()).body
    assert {ast.unparse(each) for each in top if isinstance(each, ast.Import | ast.ImportFrom)} == {
        "import os.path",
        "import signal",
        "import sys",
    }


CHILDREN = """
import os, signal, subprocess, sys, time
from types import SimpleNamespace
from cmacexp.jit import interrupt
from cmacexp.jit.interrupt import block_interrupts_of_children, interrupt_blocked, interrupt_held_back
ASK = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"

def ask():
    return subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True).stdout.strip()

def wait_after(work):
    try:
        work()
        for _ in range(1000):
            time.sleep(0.01)
    except KeyboardInterrupt:
        return "interrupted"

def press():
    return wait_after(lambda: os.kill(os.getpid(), signal.SIGINT))

@interrupt_held_back()
def press_and_go_on():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.05)

def drop():
    interrupt._raise_again(SimpleNamespace(exc_value=KeyboardInterrupt()))

signal.signal(signal.SIGINT, signal.default_int_handler)
with interrupt_blocked():
    print(ask())
print(ask(), press())
block_interrupts_of_children()
print(ask(), press(), press(), wait_after(press_and_go_on), wait_after(drop))
"""


def test_children_begin_without_being_interrupted_and_their_parent_is(tmp_path):
    done = python("-c", CHILDREN, folder=tmp_path)
    assert done.stdout.split() == ["True", "False", "interrupted", "True", *["interrupted"] * 4], done.stderr


def test_a_process_that_began_without_heeds_an_interrupt_as_soon_as_it_can():
    def press_here():  # not one of the threads that libraries have started meanwhile
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        press_here()
        with pytest.raises(KeyboardInterrupt), interrupt_unblocked():
            pytest.fail("is raised before")
        assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
        with pytest.raises(KeyboardInterrupt), interrupt_unblocked():
            press_here()
        press_here()  # waits again
    finally:
        with pytest.raises(KeyboardInterrupt):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])


@pytest.mark.parametrize("feedforward", ["cmac", "ilc"])
def test_steps_give_the_same_bits_in_any_number_of_calls(make_config, monkeypatch, feedforward):
    config = make_config(*SHORT, f"feedforward={feedforward}")
    expected = roll_out(make_scenario(config))
    monkeypatch.setattr(compiled, "LONGEST_CALL", 0.0)  # a step a call
    assert roll_out(make_scenario(config)).samples.tobytes() == expected.samples.tobytes()


def interrupt_at(monkeypatch, call):
    """Have this call of the program, a step each, interrupted from the keyboard."""
    whole, calls = compiled.fused_loop, []

    def loop(*arguments):
        calls.append(1)
        if len(calls) == call + 1:  # the first takes no step
            press()
        whole(*arguments)

    monkeypatch.setattr(compiled, "fused_loop", loop)
    monkeypatch.setattr(compiled, "LONGEST_CALL", 0.0)


def test_an_interrupt_is_heeded_within_a_cycle_and_all_steps_are_kept(make_config, monkeypatch):
    config = make_config(*SHORT)
    expected = roll_out(make_scenario(config))
    interrupt_at(monkeypatch, 130)
    rollout = roll_out(make_scenario(config))
    assert (rollout.status, rollout.cause, rollout.steps) == ("interrupted", "after step 130", 130)
    assert rollout.samples.tobytes() == expected.samples[:130].tobytes()


def test_a_call_of_the_program_takes_no_longer_than_allowed(make_config, monkeypatch):
    now, sizes = [0.0], []

    def loop(loop, progress, start, samples, body_samples):
        progress[:2] = len(samples), 0
        now[0] += 0.03 * len(samples)
        sizes.append(len(samples))

    monkeypatch.setattr(compiled, "fused_loop", loop)
    monkeypatch.setattr(compiled.time, "perf_counter", lambda: now[0])
    roll_out(make_scenario(make_config(*SHORT)))
    assert sizes[:3] == [0, 1, round(compiled.LONGEST_CALL / 0.03)]
    assert max(sizes) * 0.03 <= compiled.LONGEST_CALL


def test_an_interrupt_while_results_are_written_comes_after_them(make_config, monkeypatch, tmp_path):
    write = experiment.write_scores

    def pressed(*arguments):
        press()
        return write(*arguments)

    monkeypatch.setattr(experiment, "write_scores", pressed)
    with pytest.raises(KeyboardInterrupt):
        run_scenario(make_config(*SHORT, "record=trace"), tmp_path)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["status"] == "completed"
    assert all((tmp_path / name).is_file() for name in manifest["files"])
