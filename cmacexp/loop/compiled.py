"""The closed loop of built-in parts, fused into one compiled kernel."""

from typing import NamedTuple

from cmacexp.control.actuator import Actuator, actuate
from cmacexp.control.hybrid_kernels import HybridParams, HybridState, hybrid_feedback
from cmacexp.feedforward.kernels import FeedforwardParams, feedforward_step
from cmacexp.jit.compiler import program
from cmacexp.loop.samples import write_samples
from cmacexp.loop.stop import RUNNING, Guard, stop_reason
from cmacexp.planning.columns import ACTING, BEFORE
from cmacexp.plants.kernels import PlantParams, PlantState, advance
from cmacexp.sensors.channel import Sensing
from cmacexp.sensors.kernels import Seen, sense
from cmacexp.typing import Array, Mask, Scratch


class Torques(NamedTuple):
    """Room for the torques of one step, (L, 2) each, N m."""

    feedforward: Scratch
    total: Scratch


class FusedLoop(NamedTuple):
    """All that the fused loop works on, and no more: every array costs time whenever the loop is entered."""

    support: Mask
    """As in the plan; so are the next two."""
    reference: Array
    start_step: int
    plant: PlantParams
    plant_state: PlantState
    sensing: Sensing
    seen: Seen
    """What the controller goes by: the arrays of the plant itself where no sensor alters anything."""
    control: HybridParams
    control_state: HybridState
    feedforward: FeedforwardParams
    actuator: Actuator
    torques: Torques
    guard: Guard


@program
def fused_loop(loop: FusedLoop, start: int, samples: Array, body_samples: Array) -> tuple[int, int]:
    """Run as many steps as ``samples`` (steps, L, columns) has room for, from step ``start``.

    ``body_samples`` is (steps, columns); columns in the order of :mod:`cmacexp.loop.samples`.

    Returns:
        Steps written, and RUNNING or why it stopped after them.
    """
    plant, machine, seen, state = loop.plant, loop.plant_state, loop.seen, loop.control_state
    feedforward, total = loop.torques
    steps = samples.shape[0]
    period = loop.support.shape[0]
    if start == 0 and steps > 0:
        status = stop_reason(loop.guard, 0, machine.q, machine.dq, machine.foot, machine.force, machine.body)
        if status != RUNNING:
            return 0, status
    sample = start % period
    for k in range(steps):
        acting = start + k >= loop.start_step
        reference = loop.reference[ACTING if acting else BEFORE, sample]
        if loop.sensing.active:
            sense(loop.sensing, plant.mechanism, start + k, machine, seen)
        if acting:
            # Before the feedback, so that the learning error is still that of the last step.
            feedforward_step(loop.feedforward, start + k, sample, state.learning_error, feedforward)
        hybrid_feedback(
            loop.control, state, loop.support[sample], reference,
            seen.trig, seen.foot, seen.velocity, seen.force, seen.body, seen.body_rate,
        )  # fmt: skip
        actuate(loop.actuator, start + k, state.feedback, feedforward, total)
        write_samples(samples, body_samples, k, machine, seen, state, feedforward)
        advance(plant, machine, total)
        sample = sample + 1 if sample + 1 < period else 0
        status = stop_reason(loop.guard, sample, machine.q, machine.dq, machine.foot, machine.force, machine.body)
        if status != RUNNING:
            return k + 1, status
    return steps, RUNNING
