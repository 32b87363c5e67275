"""Quantities of :mod:`pipelines.paper_claims`, measured on runs in memory of each machine of the paper."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.compose import compose_config
from cmacexp.data.trace import Trace, concat_traces
from cmacexp.errors import BadInput
from cmacexp.loop import run_cycles
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.block import split_cycles
from cmacexp.metrics.body import compute_body
from cmacexp.metrics.registry import OF_A_CYCLE
from cmacexp.planning import Recall
from cmacexp.planning.stability import STABILITY
from cmacexp.study import Array, Status
from pipelines import one_leg_learning_trace as leg_trace
from pipelines import quadruped_walking_trace as walk_trace
from pipelines.paper_claims import METHODS

Overrides = Sequence[str]
CYCLES = (1, 2, 5)
"""Cycles of one leg that Fig. 10 to 13 show."""


class Simulated(NamedTuple):
    """A run in memory."""

    config: Config
    margins: Array
    """(N, 3): planned stability margins, m; NaN without a body."""
    trace: Trace
    status: Status
    metrics: Mapping[str, Array]
    """Metrics by name, pooled over the legs, (cycles,)."""


def simulate(overrides: Overrides, names: Sequence[str], recall: Recall | None = None) -> Simulated:
    """Run a config in memory and compute the metrics ``names``; raises BadInput if it is refused.

    Runs with the same ``recall`` share a plan that is equal.
    """
    config = compose_config(overrides, is_shared=True)
    scenario = make_scenario(config, None, recall)
    trace = concat_traces([*run_cycles(scenario)])
    block = split_cycles(trace, config.steps_per_cycle, None)
    metrics = {name: OF_A_CYCLE[name].pooling.pool(OF_A_CYCLE[name].compute(block)) for name in names}
    return Simulated(config, scenario.setup.plan.margins, trace, Status(scenario.end.status), metrics)


LEG_METRICS = {
    "force_settled": "force_settled",
    "force_rmse": "force_rmse",
    "steady": "force_steady_state_error",
    "ripple": "force_ripple",
    "transfer_x": "transfer_rmse_x",
    "transfer_y": "transfer_rmse_y",
    "support_x": "support_rmse_x",
    "share": "feedforward_share",
    "feedback": "feedback_rms",
}
"""Metrics of one leg by the name of their quantity, which ends with the number of the cycle."""
LEG_SIGNALS = ("x", "y", "x_desired", "y_desired", "force", "tau_feedback_1", "tau_feedforward_1")


def _measure_cycle(run: Simulated, cycle: int) -> dict[str, float]:
    """Measure a cycle of one leg; the names of the quantities end with its number."""
    steps = run.config.steps_per_cycle
    now = slice((cycle - 1) * steps, cycle * steps)
    plain: Any = {"sampling_period": run.config.sampling_period, "gait": vars(run.config.gait)}
    signals = {name: run.trace[name][now, 0] for name in LEG_SIGNALS} | {"support": run.trace.support[now, 0]}
    force = signals["force"]
    values = {name: abs(float(run.metrics[metric][cycle - 1])) for name, metric in LEG_METRICS.items()} | {
        "peak_x": leg_trace.peak_error(signals, plain, "x", "stroke"),
        "peak_y": leg_trace.peak_error(signals, plain, "y", "lift"),
        "force_peak": float(force[signals["support"]].max()),
        "oscillation": leg_trace.force_oscillation(signals, plain),
        "torque_step": leg_trace.torque_step(signals, plain),
        "torque_oscillation": leg_trace.torque_oscillation(signals, plain),
        "release": float(np.argmin(force > 0.0)) * run.config.sampling_period,
    }
    return {f"{name}_{cycle}": value for name, value in values.items()}


def measure_leg(
    overrides: Overrides, recall: Recall | None = None, cycles: Sequence[int] = CYCLES
) -> dict[str, float]:
    """Measure these ``cycles`` of one leg, up to the last of them; empty if the run is refused or ends early."""
    try:
        run = simulate(["scenario=one_leg", f"cycles={cycles[-1]}", *overrides], [*LEG_METRICS.values()], recall)
    except BadInput:
        return {}
    if run.status != Status.COMPLETED:
        return {}
    left = 1.0 - run.metrics["feedforward_share"]
    values = {"largest_rise": float((left[1:] / left[:-1]).max(initial=0.0))}
    return values | {name: value for cycle in cycles for name, value in _measure_cycle(run, cycle).items()}


def measure_ramp(overrides: Overrides) -> dict[str, float]:
    """Measure one leg whose desired force is a ramp; the names of the quantities begin with ``ramp_``."""
    ramp = measure_leg([*overrides, "gait.load_ramp=0.2"])
    return {f"ramp_{name}": value for name, value in ramp.items()}


MASS_METRICS = ("force_settled", "force_overshoot", "force_itae")


def measure_mass(overrides: Overrides, recall: Recall | None = None) -> dict[str, float]:
    """Measure the point mass under the four methods of force control; empty if a run is refused."""
    base = ["scenario=force_step", *overrides]
    large = ["force_control.elasticity=100", "force_control.admittance=100"]
    try:
        runs = {method: simulate([*base, f"force_control={method}"], MASS_METRICS, recall) for method in METHODS}
        doubled = simulate([*base, "force_control=damping", "force_control.desired_force=2"], MASS_METRICS, recall)
        unstable = simulate([*base, *large], MASS_METRICS, recall)
    except BadInput:
        return {}
    rest = {f"rest_{name}": _measure_rest(run) for name, run in runs.items()}
    combined = runs.pop("combined").metrics
    others = [run.metrics for name, run in runs.items() if rest[f"rest_{name}"] <= 0.02]
    damped = runs["damping"].metrics["force_settled"]
    values = {
        "doubled": float(doubled.metrics["force_settled"][0] / damped[0]),
        "rest_large_gain": _measure_rest(unstable),
    }
    for key, metric in (("overshoot", "force_overshoot"), ("itae", "force_itae")):
        values[key] = float(combined[metric][0])
        values[f"other_{key}"] = min((float(other[metric][0]) for other in others), default=math.nan)
    return rest | values


def _measure_rest(run: Simulated) -> float:
    """Return the RMS force error over the second half of a run over the desired force; infinite if it ended early."""
    if run.status != Status.COMPLETED:
        return math.inf
    over_desired = run.trace["force"] / run.trace["force_desired"] - 1.0
    return float(np.sqrt(np.mean(over_desired[run.trace.steps // 2 :] ** 2)))


WALK_METRICS = {
    "transfer_x": "transfer_rmse_x",
    "transfer_y": "transfer_rmse_y",
    "force_three": "force_rmse_three_feet",
    "force_cycle": "force_rmse_cycle",
}
"""Metrics of a walk by the name of their quantity: medians of the last cycles."""
EVENTS = ("duty_factor_off", "wave_off", "rear", "front", "front_gain", "restored")
WALK_CYCLES = 10
WALK = ("scenario=quadruped", f"cycles={WALK_CYCLES}")


def measure_walk(overrides: Overrides, recall: Recall | None = None) -> dict[str, float]:
    """Measure the quadruped with and without CMAC; without quantities of a run that is refused or falls."""
    base = [*WALK, *overrides]
    recall = recall or Recall()
    try:
        run = simulate(base, [*WALK_METRICS.values(), "feedforward_share"], recall)
        alone = simulate([*base, "feedforward=none"], [*WALK_METRICS.values()], recall)
    except BadInput:
        return {}
    values = {"done": _measure_done(run)}
    if run.status != Status.COMPLETED:
        return values
    left = 1.0 - run.metrics["feedforward_share"]
    values |= {"feedback_2": float(left[1]), "feedback_end": _find_end(left)}
    values |= {name: _find_end(run.metrics[metric]) for name, metric in WALK_METRICS.items()}
    if alone.status == Status.COMPLETED:
        values |= {f"{name}_alone": _find_end(alone.metrics[metric]) for name, metric in WALK_METRICS.items()}
    assert run.trace.body is not None
    body = compute_body(run.trace.body, run.config.steps_per_cycle, 1).to_pandas()
    height = run.config.machine.hip_height
    height_error = np.maximum(body["height_max"] - height, height - body["height_min"])[-walk_trace.LATE :].max()
    length = float(np.ptp([x for x, _ in run.config.machine.hips]))
    walk = walk_trace.Walk(run.trace, length, run.config.sampling_period)
    events = walk_trace.measure_events(walk, range(2, WALK_CYCLES + 1))
    return values | {
        "tilt": _find_end(body["tilt_max"]),
        "height_off": float(height_error) / height,
        **{name: _find_end(events[name]) for name in EVENTS},
        "two_feet": float(events["two_feet"].mean()),
        "late": float((events["force_1"] > 0.0).mean()),
        "margin_late": float(events["margin"].min()) / float(np.nanmin(run.margins[:, STABILITY])),
    }


def measure_walk_apart(overrides: Overrides) -> dict[str, float]:
    """Measure what the search does not use.

    These are walks without posture control, under position control only, and with a duty factor of 0.9.
    """
    alone = [*WALK, *overrides, "feedforward=none"]
    without = [*WALK, *overrides, "posture.gain=0", "learning.start_cycle=1"]
    only = [*alone, "posture.gain=0", "force_control.elasticity=0", "force_control.admittance=0"]
    longer = simulate([*alone, "gait.duty_factor=0.9"], ["transfer_rmse_y"])
    return {
        "done_without_posture": _measure_done(simulate(without, [])),
        "done_position_only": _measure_done(simulate(only, [])),
        "transfer_y_duty": _find_end(longer.metrics["transfer_rmse_y"]),
    }


def _find_end(values: Array) -> float:
    """Return the median of the last cycles of a walk."""
    return float(np.median(values[-walk_trace.LATE :]))


def _measure_done(run: Simulated) -> float:
    """Return the part of its cycles that a run completed."""
    return run.trace.steps / (run.config.cycles * run.config.steps_per_cycle)
