"""From the plan and the samples of the loop to the tables of a run."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

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
from cmacexp.plants.environment import make_payload
from cmacexp.typing import Array


def assemble(
    plan: Plan,
    samples: dict[str, Array],
    sampling_period: float,
    start: int = 0,
    columns: Sequence[Signal] = select_signals(LEG_SIGNALS),
    model: Array | None = None,
    steered: bool = False,
    body: Trace | None = None,
    memory: Trace | None = None,
) -> SampledTrace:
    """The trace of a run, or of a part of it, from the ``plan`` of a cycle and the samples of what is not planned.

    Samples are (steps, L) by column name. Where the controller keeps a course (``steered``), feet should be where its
    reference is; ``model`` (N, L, J), N m, is the torque of a model that the feedforward learns on top of, if any.
    """
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
    return SampledTrace({**samples, **known}, columns, (steps, legs), plan.support.take(sample, 0), body, memory)


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
