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
LATE = 5
"""Cycles at the end of a walk over which its quantities are medians."""


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


def _run_leg(overrides: Overrides, cycles: int, recall: Recall | None) -> Simulated | None:
    """Run one leg; None if it is refused or ends early."""
    try:
        run = simulate(["scenario=one_leg", f"cycles={cycles}", *overrides], [*LEG_METRICS.values()], recall)
    except BadInput:
        return None
    return run if run.status == Status.COMPLETED else None


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


def measure_feedback(overrides: Overrides, recall: Recall | None = None) -> dict[str, float]:
    """Measure the first cycle of one leg, with feedback only; empty if the run is refused or ends early."""
    run = _run_leg([*overrides, "feedforward=none"], 1, recall)
    return {} if run is None else _measure_cycle(run, 1)


def measure_leg(overrides: Overrides, recall: Recall | None = None, with_ramp: bool = False) -> dict[str, float]:
    """Measure one leg over five cycles; empty if the run is refused or ends early.

    ``with_ramp`` adds the quantities of a second run, in which the desired force is a ramp.
    """
    run = _run_leg(overrides, CYCLES[-1], recall)
    if run is None:
        return {}
    values = {name: value for cycle in CYCLES for name, value in _measure_cycle(run, cycle).items()}
    left = 1.0 - run.metrics["feedforward_share"]
    values["largest_rise"] = float((left[1:] / left[:-1]).max())
    if with_ramp:
        ramp = measure_leg([*overrides, "gait.load_ramp=0.2"])
        values |= {
            "ramp_torque_step": ramp.get("torque_step_5", math.nan),
            "ramp_feedback": ramp.get("feedback_5", math.nan),
        }
    return values


MASS_METRICS = ("force_settled", "force_overshoot", "force_itae")


def measure_mass(overrides: Overrides, recall: Recall | None = None) -> dict[str, float]:
    """Measure the point mass under the four methods of force control; empty if a run is refused."""
    base = ["scenario=force_step", *overrides]
    large = ["force_control.elasticity=100", "force_control.admittance=100"]
    try:
        runs = {method: simulate([*base, f"force_control={method}"], MASS_METRICS) for method in METHODS}
        doubled = simulate([*base, "force_control=damping", "force_control.desired_force=2"], MASS_METRICS)
        unstable = simulate([*base, *large], MASS_METRICS)
    except BadInput:
        return {}
    rest = {name: _measure_rest(run) for name, run in runs.items()}
    values = {f"rest_{name}": error for name, error in rest.items()}
    others = [runs[name].metrics for name in METHODS if name != "combined" and rest[name] <= 0.02]
    combined = runs["combined"].metrics
    for key, metric in (("overshoot", "force_overshoot"), ("itae", "force_itae")):
        values[key] = float(combined[metric][0])
        values[f"other_{key}"] = min((float(other[metric][0]) for other in others), default=math.nan)
    once = runs["damping"].metrics["force_settled"][0]
    values["doubled"] = float(doubled.metrics["force_settled"][0] / once)
    values["rest_large_gain"] = _measure_rest(unstable)
    return values


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


def measure_walk(overrides: Overrides, recall: Recall | None = None, apart: bool = False) -> dict[str, float]:
    """Measure the quadruped with and without CMAC; without quantities of a run that is refused or falls.

    ``apart`` adds the quantities that the search does not use.
    """
    base = ["scenario=quadruped", f"cycles={WALK_CYCLES}", *overrides]
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
    values |= {"feedback_2": float(left[1]), "feedback_end": float(np.median(left[-LATE:]))}
    values |= {name: float(np.median(run.metrics[metric][-LATE:])) for name, metric in WALK_METRICS.items()}
    if alone.status == Status.COMPLETED:
        values |= {
            f"{name}_alone": float(np.median(alone.metrics[metric][-LATE:])) for name, metric in WALK_METRICS.items()
        }
    assert run.trace.body is not None
    body = compute_body(run.trace.body, run.config.steps_per_cycle, 1).to_pandas()
    height = run.config.machine.hip_height
    below, above = height - body["height_min"][-LATE:].min(), body["height_max"][-LATE:].max() - height
    values |= {"tilt": float(body["tilt_max"][-LATE:].median()), "height_off": float(max(below, above)) / height}
    length = float(np.ptp([x for x, _ in run.config.machine.hips]))
    events = walk_trace.measure_events(
        walk_trace.Walk(run.trace, length, run.config.sampling_period), range(2, WALK_CYCLES + 1)
    )
    values |= {name: float(events[name][-LATE:].median()) for name in EVENTS}
    values["two_feet"] = float(events["two_feet"].mean())
    values["late"] = float((events["force_1"] > 0.0).mean())
    values["margin_late"] = float(events["margin"].min()) / float(np.nanmin(run.margins[:, STABILITY]))
    if apart:
        without = [*base, "posture.gain=0", "learning.start_cycle=1"]
        only = [
            *base,
            "feedforward=none",
            "posture.gain=0",
            "force_control.elasticity=0",
            "force_control.admittance=0",
        ]
        longer = [*base, "feedforward=none", "gait.duty_factor=0.9"]
        values["done_without_posture"] = _measure_done(simulate(without, []))
        values["done_position_only"] = _measure_done(simulate(only, []))
        transfer = simulate(longer, ["transfer_rmse_y"]).metrics["transfer_rmse_y"]
        values["transfer_y_duty"] = float(np.median(transfer[-LATE:]))
    return values


def _measure_done(run: Simulated) -> float:
    """Return the part of its cycles that a run completed."""
    return run.trace.steps / (run.config.cycles * run.config.steps_per_cycle)
