"""Traces of a run, made from its plan and the samples of the loop: tables of legs, body and network memory."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cmacexp.config.machine import QuadrupedMachine, RobotMachine
from cmacexp.control import DriveController, HybridController
from cmacexp.data.signals import (
    ARRAYS,
    BODY_SIGNALS,
    LEG_SIGNALS,
    LIVE_SIGNALS,
    MEMORY_SIGNALS,
    MODEL_SIGNALS,
    PHASES,
    SPATIAL_SIGNALS,
    TRUE_MARGINS,
    Signal,
    make_schema,
    select_signals,
)
from cmacexp.data.tables import arrow, arrow_strings
from cmacexp.data.trace import Trace
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.loop.samples import WIDE_BODY_SAMPLES, name_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.models.mechanism import PLANE, has_body
from cmacexp.planning.machine import find_centres
from cmacexp.planning.plan import Setup
from cmacexp.planning.reference import X, Y, Z
from cmacexp.planning.stability import FRONT, REAR, STABILITY, Masses, true_margins
from cmacexp.plants.as_built import make_payload
from cmacexp.protocols import ListsSteps, offers
from cmacexp.typing import Array


class TraceColumns(NamedTuple):
    """Columns of the tables of a trace."""

    legs: tuple[Signal, ...]
    body: tuple[Signal, ...] | None
    """Columns of the body; None for a machine without one."""


def select_columns(scenario: Scenario) -> TraceColumns:
    """Select the columns of a trace; altering sensors and force fault detection add columns."""
    mechanism = scenario.setup.mechanism
    legs = LEG_SIGNALS if mechanism.shape[1] == len(PLANE) else (*LEG_SIGNALS, *SPATIAL_SIGNALS)
    if _find_model_torque(scenario) is not None:
        legs = (*legs, *MODEL_SIGNALS[: mechanism.shape[1]])
    columns = select_signals(legs, scenario.altered, scenario.setup.config.plausibility.enabled)
    if not has_body(mechanism):
        return TraceColumns(columns, None)
    body = (*BODY_SIGNALS, *LIVE_SIGNALS) if offers(scenario.plant, ListsSteps) else BODY_SIGNALS
    return TraceColumns(columns, select_signals(body, scenario.altered))


def _find_model_torque(scenario: Scenario) -> Array | None:
    """Return the model torque (N, L, J), N m, that a built-in feedforward improves by learning, if it has one."""
    feedforward = scenario.feedforward
    return feedforward.model_torque if isinstance(feedforward, BuiltInFeedforward) else None


def _keeps_course(scenario: Scenario) -> bool:
    """Return True if the controller steers; the desired feet are then its reference, not the plan."""
    controller = scenario.controller
    if scenario.fault is not None or not isinstance(controller, HybridController | DriveController):
        return False
    return controller.params.steering is not None


def make_trace(
    scenario: Scenario,
    columns: TraceColumns,
    start: int,
    samples: Array,
    body_samples: Array,
    memory: Mapping[str, Array] | None = None,
    live: Mapping[str, Array] | None = None,
) -> Trace:
    """Make the trace of K steps of a run from step ``start`` on.

    Args:
        scenario: the scenario that runs.
        columns: columns chosen by :func:`select_columns`.
        start: number of the first step.
        samples: leg samples (columns, K, L), ordered as in :mod:`cmacexp.loop.samples`.
        body_samples: body samples (columns, K).
        memory: memory signals of networks at the end of each cycle, (cycles, L) by name.
        live: LIVE_SIGNALS of a machine that is not simulated, (K,) by name.
    """
    setup = scenario.setup
    legs = name_samples(samples)
    body = None
    if columns.body is not None:
        named = name_samples(body_samples, WIDE_BODY_SAMPLES) | dict(live or {})
        body = Trace(_make_body_table(setup, columns.body, start, named, legs, scenario.first.travel is not None))
    planned = _list_planned(setup, start, samples.shape[1])
    if _keeps_course(scenario):
        planned |= {f"{axis}_desired": legs[f"{axis}_reference"] for axis in "xz"}
    if (torque := _find_model_torque(scenario)) is not None:
        acting = planned["step"] >= setup.plan.start_step
        sample = planned["step"][:, 0] % len(torque)
        for joint, signal in enumerate(MODEL_SIGNALS[: torque.shape[2]]):
            planned[signal.name] = np.where(acting, torque[sample, :, joint], 0.0)
    first_cycle = start // setup.config.steps_per_cycle + 1
    cycles = None if memory is None else _make_memory_trace(memory, first_cycle)
    return Trace(_make_table(columns.legs, {**legs, **planned}, samples.shape[1:]), body, cycles)


def _make_table(columns: Sequence[Signal], values: Mapping[str, NDArray[Any]], shape: tuple[int, ...]) -> pa.Table:
    """Make a table of ``values`` by name, which broadcast to ``shape``; ``phase`` is True in support."""
    arrays = []
    for signal in columns:
        column = values[signal.name]
        column = column.ravel() if column.shape == shape else np.broadcast_to(column, shape).ravel()
        if signal.name == "phase":
            arrays.append(pa.DictionaryArray.from_arrays(arrow(column, pa.int8()), arrow_strings(PHASES)))
        else:
            arrays.append(arrow(column, signal.type))
    return pa.Table.from_arrays(arrays, schema=make_schema(columns))


def _list_planned(setup: Setup, start: int, steps: int) -> dict[str, NDArray[Any]]:
    """Return the planned signals of ``steps`` steps from ``start`` on, by name; they broadcast to (steps, L)."""
    plan = setup.plan
    config = setup.config
    step = np.arange(start, start + steps, dtype=np.int32)[:, None]
    sample = step[:, 0] % config.steps_per_cycle
    foot = plan.desired.position.take(sample, 0)  # eight times as fast as indexing
    planned: dict[str, NDArray[Any]] = {
        "step": step,
        "time": step * config.sampling_period,
        "cycle": step // config.steps_per_cycle + 1,
        "leg": np.arange(1, foot.shape[1] + 1, dtype=np.int32),
        "phase": plan.support.take(sample, 0),
        "progress": plan.progress.take(sample, 0),
        "x_desired": foot[..., X],
        "y_desired": foot[..., Y],
        "force_desired": plan.force_desired.take(sample, 0),
    }
    if foot.shape[2] > Z:
        angle = plan.joints.position.take(sample, 0)
        planned["z_desired"] = foot[..., Z]
        planned |= {f"q{joint + 1}_desired": angle[..., joint] for joint in range(angle.shape[2])}
    return planned


def _make_body_table(
    setup: Setup,
    columns: Sequence[Signal],
    start: int,
    samples: Mapping[str, Array],
    legs: Mapping[str, Array],
    is_moved: bool,
) -> pa.Table:
    """Make the table of the body, one row per step, from ``samples`` (K,) and leg samples (K, L) by name.

    ``is_moved``: the plant moves the body, whose centre of gravity then includes the legs; else the whole weight acts
    at the centre of the body.
    """
    config = setup.config
    force = legs["force"]
    step = np.arange(start, start + len(force), dtype=np.int32)
    planned = setup.plan.margins[step % config.steps_per_cycle]
    payload = make_payload(config.payload, config.sampling_period)
    body_mass = config.machine.body_mass if is_moved and isinstance(config.machine, QuadrupedMachine) else None
    centre = None
    if isinstance(config.machine, RobotMachine):
        centre = find_centres(config.machine, np.stack([legs[name] for name in ARRAYS["q"]], axis=2))
    masses = Masses(setup.mechanism, body_mass, payload.load, step >= payload.start, centre)
    margins = true_margins(masses, dict(legs), dict(samples))
    values = {
        **samples,
        "step": step,
        "time": step * config.sampling_period,
        "cycle": step // config.steps_per_cycle + 1,
        "stability_margin": planned[:, STABILITY],
        "margin_front": planned[:, FRONT],
        "margin_rear": planned[:, REAR],
        "supporting_legs": ((force > 0.0) << np.arange(force.shape[1])).sum(axis=1),
        **dict(zip(TRUE_MARGINS, margins.T, strict=True)),
    }
    return _make_table(columns, values, step.shape)


def _make_memory_trace(memory: Mapping[str, Array], first_cycle: int) -> Trace:
    """Make the table of ``memory`` signals, (cycles, L) by name, with one row per cycle and leg."""
    cycles, legs = next(iter(memory.values())).shape
    index = {"cycle": np.arange(first_cycle, first_cycle + cycles)[:, None], "leg": np.arange(1, legs + 1)}
    return Trace(_make_table(MEMORY_SIGNALS, {**memory, **index}, (cycles, legs)))
