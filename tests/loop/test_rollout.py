"""Laws of the closed loop: runs repeat to the bit, and nothing that stops a run loses its trace."""

import dataclasses
import re

import numpy as np
import pytest
from support.loops import run_elsewhere, same_bits
from support.rollout import roll_out

from cmacexp.config import config_hash, to_plain
from cmacexp.data.parquet import write_table
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.stop import FASTEST_JOINT
from cmacexp.loop.trace import assemble


def run(config, **options):
    return roll_out(make_scenario(config), **options)


# What the rows say


@pytest.mark.parametrize("limit", ["null", 2.5])
def test_a_row_holds_the_state_at_the_start_of_its_step_and_the_torque_held_during_it(make_config, limit):
    scenario = make_scenario(make_config("cycles=2", f"actuator.torque_limit={limit}", "plant.substeps=2"))
    columns = roll_out(scenario).columns()
    machine, torques = make_scenario(scenario.setup.config), np.zeros((1, 2))
    state = machine.first
    for k in range(1200):
        assert (columns["q1"][k, 0], columns["dq2"][k, 0]) == (state.q[0, 0], state.dq[0, 1])
        assert (columns["y"][k, 0], columns["force"][k, 0]) == (state.foot[0, 1], state.force[0])
        for j in (0, 1):
            torques[0, j] = columns[f"tau_feedback_{j + 1}"][k, 0] + columns[f"tau_feedforward_{j + 1}"][k, 0]
        assert limit == "null" or np.abs(torques).max() <= limit
        state = machine.plant.step(torques)


@pytest.mark.parametrize("lead", [-1, 0, 2])
def test_feedback_trains_the_cells_of_its_step_less_the_lead_before_the_next_prediction(make_config, lead):
    config = make_config("cycles=3", f"learning.lead={lead}", "learning.rate=0.3", "cmac.memory_bytes=16384")
    scenario = make_scenario(config)
    cells, weights = scenario.feedforward.params.cells[:, 0], np.zeros((1024, 2))
    columns = roll_out(scenario).columns()
    feedback, feedforward = (
        np.column_stack([columns[f"tau_{part}_1"], columns[f"tau_{part}_2"]]) for part in ("feedback", "feedforward")
    )
    assert not feedforward[:600].any()  # the first cycle is the baseline
    for k in range(600, 1800):
        np.add.at(weights, cells[(k - 1 - lead) % 600], 0.3 * feedback[k - 1] / config.cmac.layers)
        np.testing.assert_allclose(feedforward[k], weights[cells[k % 600]].sum(axis=0), rtol=1e-9, atol=1e-12)


def test_the_trace_repeats_the_plan_and_holds_the_samples(make_config):
    rollout = run(make_config("cycles=2"))
    trace = assemble(rollout.plan, rollout.columns(), 0.005).to_pydict()
    planned = {
        "y_desired": rollout.plan.desired[:, 0, 1], "x_desired": rollout.plan.desired[:, 0, 0],
        "progress": rollout.plan.progress[:, 0], "force_desired": rollout.plan.force_desired[:, 0],
        "phase": np.where(rollout.plan.support[:, 0], "support", "transfer"),
    }  # fmt: skip
    for name, values in planned.items():
        assert trace[name] == [*values, *values]
    for name, values in rollout.columns().items():
        assert trace[name] == values[:, 0].tolist()
    assert trace["step"] == list(range(1200))
    assert trace["cycle"] == [1] * 600 + [2] * 600
    assert trace["time"] == [k * 0.005 for k in range(1200)]


# The same run again


def test_the_same_seed_gives_the_same_bytes_in_another_process(make_config, tmp_path):
    overrides = "scenario=one_leg", "cycles=3", "seed=7"
    config = make_config(*overrides)
    rollout = run(config)
    write_table(assemble(rollout.plan, rollout.columns(), config.sampling_period), tmp_path / "here.parquet")
    assert same_bits(run_elsewhere(tmp_path, overrides).samples, rollout.samples)
    assert (tmp_path / "trace.parquet").read_bytes() == (tmp_path / "here.parquet").read_bytes()


def test_another_seed_gives_another_hash_and_other_samples(make_config):
    one, other = (make_config("cycles=3", "cmac.memory_bytes=4096", f"seed={seed}") for seed in (0, 1))
    assert config_hash(to_plain(one)) != config_hash(to_plain(other))
    first, second = run(one).samples, run(other).samples
    assert same_bits(first[:600], second[:600])  # before the CMAC acts
    assert not same_bits(first, second)


# Runs that stop


def test_a_diverging_run_stops_at_once_and_says_where(make_config):
    config = make_config("scenario=one_leg", "controller.velocity_gain=80")
    rollout = run(config)
    step, time, joint, speed = re.fullmatch(
        r"at step (\d+) \(t = ([\d.]+) s\): joint ([12]) of leg 1 moves at ([\d.e+]+) rad/s, above 100 rad/s",
        rollout.cause,
    ).groups()
    assert rollout.status == "diverged"
    assert len(rollout.samples) == int(step) == round(float(time) / 0.005) < 3000
    assert float(speed) > FASTEST_JOINT
    columns = rollout.columns()
    assert np.isfinite(rollout.samples).all()
    assert max(np.abs(columns["dq1"]).max(), np.abs(columns["dq2"]).max()) <= FASTEST_JOINT
    assert np.abs(columns[f"dq{joint}"][-1]) > 0.1 * FASTEST_JOINT
    assert run(config, fused=False).cause == rollout.cause


class Faulty:
    """A part that does what another does, until its ``method`` is called for the given time."""

    def __init__(self, part, method, calls, fault):
        self.part, self.method, self.calls, self.fault = part, method, calls, fault

    def __getattr__(self, name):
        inner = getattr(self.part, name)
        if name != self.method:
            return inner

        def counted(*arguments):
            self.calls -= 1
            return self.fault(inner, *arguments) if self.calls == 0 else inner(*arguments)

        return counted


def breaks(inner, *arguments):
    raise RuntimeError("cable cut")


def with_faulty(config, part, method, calls, fault):
    scenario = make_scenario(config)
    return dataclasses.replace(scenario, **{part: Faulty(getattr(scenario, part), method, calls, fault)})


@pytest.mark.parametrize("step", [100, 750])
@pytest.mark.parametrize(("part", "method"), [("plant", "step"), ("controller", "act"), ("sensors", "measure")])
def test_a_part_that_raises_fails_the_run_and_keeps_the_trace_up_to_there(make_config, part, method, step):
    config = make_config("cycles=2")
    rollout = roll_out(with_faulty(config, part, method, step + 1, breaks))
    assert rollout.status == "failed"
    assert "RuntimeError: cable cut" in rollout.cause
    assert isinstance(rollout.error, RuntimeError)
    kept = len(rollout.samples)
    assert kept in (step, step + 1)  # of the step in which a plant fails the beginning is known
    assert same_bits(rollout.samples[:step], run(config, fused=False).samples[:step])
    assert assemble(rollout.plan, rollout.columns(), 0.005).num_rows == kept


def test_an_interrupt_between_cycles_keeps_the_cycles_done(make_config):
    def watch(cycle):
        if cycle == 2:
            raise KeyboardInterrupt

    config = make_config("cycles=4")
    rollout = run(config, watch=watch, fused=False)
    assert rollout.status == "interrupted"
    assert rollout.cause
    assert same_bits(rollout.samples, run(config).samples[:1200])


def test_an_exception_in_watch_fails_the_run(make_config):
    rollout = run(make_config("cycles=2"), watch=lambda cycle: breaks(None), fused=False)
    assert rollout.status == "failed"
    assert len(rollout.samples) == 1


@pytest.mark.parametrize("field", ["q", "dq", "foot", "force"])
def test_a_measurement_that_is_not_finite_diverges_and_is_named_so(make_config, field):
    def spoil(inner, *arguments):
        measured = inner(*arguments)
        return measured._replace(**{field: measured._asdict()[field] * np.nan})

    rollout = roll_out(with_faulty(make_config("cycles=1"), "plant", "step", 100, spoil))
    assert rollout.status == "diverged"
    assert len(rollout.samples) == 100
    assert "not finite" in rollout.cause
