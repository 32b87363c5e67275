"""From the plan and the samples of the loop to the tables of a run."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cmacexp.config.machine import QuadrupedMachine, RobotMachine
from cmacexp.data.signals import (
    ARRAYS,
    BODY_SIGNALS,
    LEG_SIGNALS,
    MEMORY_SIGNALS,
    MODEL_SIGNALS,
    TRUE_MARGINS,
    Signal,
    make_schema,
    select_signals,
)
from cmacexp.data.tables import arrow
from cmacexp.data.trace import SampledTrace, Trace
from cmacexp.planning.machine import find_centres
from cmacexp.planning.plan import Plan, Setup
from cmacexp.planning.reference import X, Y, Z
from cmacexp.planning.stability import FRONT, REAR, STABILITY, Masses, true_margins
from cmacexp.plants.as_built import make_payload
from cmacexp.typing import Array


class Sampled(NamedTuple):
    """What was sampled of a run, or of a part of it, and what its trace needs besides."""

    plan: Plan
    """Plan of a cycle."""
    samples: dict[str, Array]
    """Samples of what is not planned, (steps, L) by column name."""
    sampling_period: float
    """s."""
    start: int = 0
    """Its first step."""
    columns: Sequence[Signal] = select_signals(LEG_SIGNALS)
    model: Array | None = None
    """(N, L, J): torque of a model that the feedforward learns on top of, if any, N m."""
    steered: bool = False
    """Whether the controller keeps a course: feet should then be where its reference is."""
    body: Trace | None = None
    memory: dict[str, Array] | None = None
    """Signals of networks, (cycles, L) by column name."""


def assemble(sampled: Sampled) -> SampledTrace:
    """The trace of a run, or of a part of it."""
    plan, samples, sampling_period, start, columns, model, steered, body, memory = sampled
    steps, legs = samples["x"].shape
    period = plan.support.shape[0]
    step = np.arange(start, start + steps, dtype=np.int32)[:, None]
    sample = step[:, 0] % period
    foot = plan.desired.position.take(sample, 0)  # which takes an eighth of the time of an index
    known = {
        "step": step,
        "time": step * sampling_period,
        "cycle": step // period + 1,
        "leg": np.arange(1, legs + 1, dtype=np.int32),
        "progress": plan.progress.take(sample, 0),
        "x_desired": foot[..., X],
        "y_desired": foot[..., Y],
        "force_desired": plan.force_desired.take(sample, 0),
    }
    if foot.shape[2] > Z:
        known["z_desired"], angle = foot[..., Z], plan.joints.position.take(sample, 0)
        known |= {f"q{joint + 1}_desired": angle[..., joint] for joint in range(angle.shape[2])}
    if steered:
        known |= {f"{axis}_desired": samples[f"{axis}_reference"] for axis in "xz"}
    if model is not None:
        acting = step >= plan.start_step
        for joint in range(model.shape[2]):
            known[MODEL_SIGNALS[joint].name] = np.where(acting, model[sample, :, joint], 0.0)
    own = None if memory is None else assemble_memory(memory, start // period + 1)
    return SampledTrace({**samples, **known}, columns, (steps, legs), plan.support.take(sample, 0), body, own)


def _put_beside(arrays: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Arrays (N, L, ...) of runs as one with the legs of all of them."""
    return np.concatenate(list(arrays), axis=1)


def join_runs(runs: Sequence[Sampled]) -> Sampled:
    """Whole runs as one, with the legs of all side by side, and without bodies.

    They must have equally many steps, of the same phases, and the same columns.
    """
    first, plans = runs[0], [run.plan for run in runs]
    plan = first.plan._replace(
        support=_put_beside(plan.support for plan in plans),
        progress=_put_beside(plan.progress for plan in plans),
        desired=first.plan.desired._replace(position=_put_beside(plan.desired.position for plan in plans)),
        joints=first.plan.joints._replace(position=_put_beside(plan.joints.position for plan in plans)),
        force_desired=_put_beside(plan.force_desired for plan in plans),
    )
    # Transposed: of runs of one leg the steps of each stay in one piece.
    samples = {name: np.concatenate([run.samples[name].T for run in runs]).T for name in first.samples}
    model = None if first.model is None else _put_beside(run.model for run in runs if run.model is not None)
    memories = [run.memory for run in runs if run.memory is not None]
    memory = {name: _put_beside(own[name] for own in memories) for name in memories[0]} if memories else None
    return first._replace(plan=plan, samples=samples, model=model, body=None, memory=memory)


def assemble_body(
    setup: Setup,
    samples: dict[str, Array],
    legs: dict[str, Array],
    moves: bool,
    start: int = 0,
    columns: Sequence[Signal] = select_signals(BODY_SIGNALS),
) -> pa.Table:
    """The trace of a body, or of a part of it, one row per step, from samples (steps,) by column name.

    Legs are (steps, L), as for :func:`assemble`; they load the body where the plant ``moves`` it, else its weight
    acts at its centre.
    """
    config, force = setup.config, legs["force"]
    step = np.arange(start, start + len(force), dtype=np.int32)
    planned = setup.plan.margins[step % config.steps_per_cycle]
    payload = make_payload(config.payload, config.sampling_period)
    body_mass = config.machine.body_mass if moves and isinstance(config.machine, QuadrupedMachine) else None
    centre = None
    if isinstance(config.machine, RobotMachine):
        centre = find_centres(config.machine, np.stack([legs[name] for name in ARRAYS["q"]], axis=2))
    masses = Masses(setup.mechanism, body_mass, payload.load, step >= payload.start, centre)
    true = true_margins(masses, legs, samples)
    known = {
        **samples,
        "step": step,
        "time": step * config.sampling_period,
        "cycle": step // config.steps_per_cycle + 1,
        "stability_margin": planned[:, STABILITY],
        "margin_front": planned[:, FRONT],
        "margin_rear": planned[:, REAR],
        "supporting_legs": ((force > 0.0) << np.arange(force.shape[1])).sum(axis=1),
        **dict(zip(TRUE_MARGINS, true.T, strict=True)),
    }
    return pa.Table.from_arrays([arrow(known[c.name], c.type) for c in columns], schema=make_schema(columns))


def assemble_memory(memory: dict[str, Array], first_cycle: int) -> SampledTrace:
    """The memory of networks, columns (cycles, L) by name from ``first_cycle``, as rows of one cycle and leg each."""
    cycles, legs = next(iter(memory.values())).shape
    numbers = {"cycle": np.arange(first_cycle, first_cycle + cycles)[:, None], "leg": np.arange(1, legs + 1)}
    return SampledTrace(memory | numbers, MEMORY_SIGNALS, (cycles, legs))
