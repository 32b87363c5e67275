"""Ctrl-C, SIGTERM and SIGHUP: they wait where they would do harm, and all steps that were taken are kept."""

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from support.command import cmacexp, started
from support.rollout import roll_out

from cmacexp.commands.command import run_command
from cmacexp.experiment import run as experiment
from cmacexp.experiment.run import run_scenario
from cmacexp.jit.interrupt import handled, interrupt_held_back, interrupted_exit_code, raise_if_interrupted
from cmacexp.loop import compiled
from cmacexp.loop import run as loop
from cmacexp.loop.scenario import make_scenario

SHORT = ("cycles=2", "gait.cycle_time=0.5", "gait.stroke=0.02", "learning.start_cycle=1")


@pytest.fixture(autouse=True)
def heeds():
    """This process heeds interrupts, even if it was started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
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
        with pytest.raises(KeyboardInterrupt), interrupt_held_back(False):
            pytest.fail("is raised before")
        with pytest.raises(KeyboardInterrupt), interrupt_held_back(False):
            press()


def test_a_second_interrupt_does_not_wait():
    with interrupt_held_back():
        press()
        with pytest.raises(KeyboardInterrupt):
            press()


def test_a_process_that_ignores_interrupts_goes_on_doing_so():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with handled(), interrupt_held_back():
        press()
        raise_if_interrupted()


def test_an_error_that_a_library_makes_of_an_interrupt_is_one(capsys):
    def compose():
        try:
            press()
        finally:
            raise AttributeError("half made")

    assert run_command(compose) == 130
    assert capsys.readouterr().err == "interrupted\n"
    with pytest.raises(ZeroDivisionError):
        run_command(lambda: 1 // 0)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_command_handles_signals_that_end_a_process(number, code):
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt), handled():
        press(number)
    assert interrupted_exit_code() == code
    assert signal.getsignal(number) is before


LONG = ["cycles=1000000", "feedforward=none", "record.cycles=[1]"]


def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    words = ["-m", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "seed=1,2", *LONG, "hydra.sweep.dir=s"]
    process = started(*words, folder=tmp_path)
    lock, pids = tmp_path / "s" / "0" / ".cmacexp-lock", []
    while not (pids := lock.read_text().split() if lock.exists() else []) and process.poll() is None:
        time.sleep(0.05)
    refused = cmacexp("cycles=1", "hydra.run.dir=s/0", folder=tmp_path)
    assert (refused.returncode, f"process {pids[0]} writes here" in refused.stderr) == (2, True)
    process.kill()
    process.wait()
    for _ in range(200):
        if not Path(f"/proc/{pids[0]}").exists():
            break
        time.sleep(0.1)
    else:
        pytest.fail("the worker goes on")


@pytest.mark.parametrize("feedforward", ["cmac", "ilc"])
def test_steps_give_the_same_bits_in_any_number_of_calls(make_config, monkeypatch, feedforward):
    config = make_config(*SHORT, f"feedforward={feedforward}")
    expected = roll_out(make_scenario(config))
    monkeypatch.setattr(loop, "LONGEST_CALL", 0.0)  # a step a call
    assert roll_out(make_scenario(config)).samples.tobytes() == expected.samples.tobytes()


def interrupt_at(monkeypatch, call):
    """Have this call of the program, a step each, interrupted from the keyboard."""
    whole, calls = compiled.fused_loop, []

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) == call + 1:  # the first takes no step
            press()
        whole(*arguments)

    monkeypatch.setattr(compiled, "fused_loop", interrupted)
    monkeypatch.setattr(loop, "LONGEST_CALL", 0.0)


def test_an_interrupt_is_heeded_within_a_cycle_and_all_steps_are_kept(make_config, monkeypatch):
    config = make_config(*SHORT)
    expected = roll_out(make_scenario(config))
    interrupt_at(monkeypatch, 130)
    rollout = roll_out(make_scenario(config))
    assert (rollout.status, rollout.cause, rollout.steps) == ("interrupted", "after step 130", 130)
    assert rollout.samples.tobytes() == expected.samples[:130].tobytes()


def test_a_call_of_the_program_takes_no_longer_than_allowed(make_config, monkeypatch):
    now, sizes = [0.0], []

    def count(loop, progress, start, samples, body_samples):
        progress[:2] = len(samples), 0
        now[0] += 0.03 * len(samples)
        sizes.append(len(samples))

    monkeypatch.setattr(compiled, "fused_loop", count)
    monkeypatch.setattr(loop.time, "perf_counter", lambda: now[0])
    watched = []
    roll_out(make_scenario(make_config(*SHORT)), watched.append)
    assert sizes[1:] == np.rint(np.diff([0.0, *watched]) * 100).tolist(), "progress is shown after each"
    assert sizes[:3] == [0, 1, round(loop.LONGEST_CALL / 0.03)]
    assert max(sizes) * 0.03 <= loop.LONGEST_CALL


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
