"""Laws of the closed loop: what its rows say, external components, and what a run that stops leaves."""

from itertools import count
from unittest.mock import Mock

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from support.doors import make_scenario, roll_out
from support.loops import make_external

from cmacexp.loop.stop import FASTEST_JOINT

SAMPLES = 40
SHORT = ("gait.cycle_time=0.2", "gait.lift=0.005")


@pytest.fixture
def run(make_config):
    """``run("cycles=3")`` gives the run of one leg with so short a cycle."""
    return lambda *overrides, **options: roll_out(make_scenario(make_config(*SHORT, *overrides)), **options)


# What the rows say


def test_another_seed_gives_other_samples_as_soon_as_the_cmac_acts(run):
    first, again, other = (run("cycles=2", "cmac.memory_bytes=4096", f"seed={seed}").samples for seed in (0, 0, 1))
    assert_array_equal(first, again)
    assert_array_equal(first[:SAMPLES], other[:SAMPLES])
    assert (first[SAMPLES:] != other[SAMPLES:]).any()


# Runs that stop


def test_a_diverging_run_stops_at_once_and_says_where(make_config):
    rollout = roll_out(make_scenario(make_config("scenario=one_leg", "controller.velocity_gain=80")))
    columns, steps = rollout.columns(), len(rollout.samples)
    assert rollout.status == "diverged"
    assert rollout.cause.startswith(f"at step {steps} (t = {0.005 * steps:.3f} s): joint ")
    assert np.isfinite(rollout.samples).all()
    speeds = np.abs(np.column_stack([columns["dq1"], columns["dq2"]]))
    assert 0.1 * FASTEST_JOINT < speeds[-1].max() <= speeds.max() <= FASTEST_JOINT


def breaks(inner, *arguments):
    raise RuntimeError("cable cut")


def run_with_faulty(make_config, part, method, at, fault):
    """A run with an external ``part``, which has a fault at one of the calls of its ``method``."""
    scenario, calls = make_external(make_scenario(make_config(*SHORT, "cycles=2")), part), count(1)
    inner = getattr(getattr(scenario, part), method)

    def called(*arguments):
        return fault(inner, *arguments) if next(calls) == at else inner(*arguments)

    setattr(getattr(scenario, part), method, called)
    return roll_out(scenario)


@pytest.mark.parametrize("step", [10, 50])
@pytest.mark.parametrize(("part", "method"), [("plant", "step"), ("controller", "act"), ("sensors", "measure")])
def test_a_part_that_raises_fails_the_run_and_keeps_the_trace_up_to_there(make_config, run, part, method, step):
    rollout = run_with_faulty(make_config, part, method, step + 1, breaks)
    assert rollout.status == "failed"
    assert "RuntimeError: cable cut" in rollout.cause
    assert isinstance(rollout.error, RuntimeError)
    assert len(rollout.samples) in (step, step + 1)  # of the step in which a plant fails the beginning is known
    assert_array_equal(rollout.samples[:step], run("cycles=2").samples[:step])


@pytest.mark.parametrize("field", ["q", "dq", "foot", "force"])
def test_a_measurement_that_is_not_finite_diverges_and_is_named_so(make_config, field):
    def spoil(inner, *arguments):
        measured = inner(*arguments)
        return measured._replace(**{field: measured._asdict()[field] * np.nan})

    rollout = run_with_faulty(make_config, "plant", "step", 20, spoil)
    assert (rollout.status, len(rollout.samples)) == ("diverged", 20)
    assert "not finite" in rollout.cause


def test_an_interrupt_keeps_the_steps_done_and_an_exception_fails_the_run(make_config, run):
    def interrupt(cycle):
        if cycle >= 2:
            raise KeyboardInterrupt

    def run_with(watch):
        return roll_out(make_external(make_scenario(make_config(*SHORT, "cycles=4")), "plant"), watch)

    stopped, failed = (run_with(watch) for watch in (interrupt, lambda cycle: breaks(None)))
    assert (stopped.status, stopped.steps) == ("interrupted", len(stopped.samples))
    assert_array_equal(stopped.samples, run("cycles=4").samples[: stopped.steps])
    assert (failed.status, len(failed.samples)) == ("failed", 1)


# External components


CALLED = {"sensors": "measure", "controller": "act", "feedforward": "predict", "plant": "step"}


@pytest.mark.parametrize(
    ("scenario", "groups"),
    [
        *(("one_leg", (group,)) for group in CALLED),
        ("quadruped", ("sensors", "plant")),
        ("quadruped", ("feedforward",)),
        ("quadruped", tuple(CALLED)),
    ],
    ids=str,
)
def test_a_run_has_the_same_bits_whichever_components_are_external(make_config, scenario, groups):
    sensors = ("sensors=real", "sensors.position.bias=1e-3", "sensors.force.bias=0.1")
    short = ("gait.cycle_time=0.2", "gait.lift=0.005", "cycles=3", "learning.start_cycle=2")
    config = make_config(f"scenario={scenario}", *short, *sensors)
    built_in, inside = roll_out(make_scenario(config)), make_external(make_scenario(config), *groups)
    methods = {group: Mock(wraps=getattr(getattr(inside, group), CALLED[group])) for group in groups}
    for group, method in methods.items():
        setattr(getattr(inside, group), CALLED[group], method)
    mixed, steps = roll_out(inside), len(built_in.samples)
    assert steps == (120 if scenario == "one_leg" else 42)  # four legs cannot walk so fast: they fall
    assert mixed.status == built_in.status
    assert_array_equal(mixed.samples, built_in.samples)
    assert_array_equal(mixed.body_samples, built_in.body_samples)
    assert np.abs(mixed.columns()["tau_feedforward_1"][41:]).max() > 0.0
    for group, method in methods.items():
        asked = steps
        if group == "feedforward":  # not before it acts; and a controller calls the one that it was given
            asked = 0 if "controller" in groups else steps - 40
        assert method.call_count == asked
