"""The driver for built-in components: all steps in one compiled program."""

import numpy as np

from cmacexp.control.actuator import actuate
from cmacexp.jit.compiler import program
from cmacexp.loop.guard import lets_act
from cmacexp.loop.samples import make_samples
from cmacexp.loop.samples import write_samples as commit
from cmacexp.loop.step import (
    STOP,
    TAKEN,
    Loop,
    advance_plant,
    begin,
    check,
    control,
    guard_step,
    guard_torque,
    observe,
    predict,
)
from cmacexp.loop.stop import RUNNING
from cmacexp.planning.columns import ACTING, BEFORE
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array, Counts


@program
def fused_loop(loop: Loop, progress: Counts, start: int, samples: Array, body_samples: Array) -> None:
    """:func:`cmacexp.loop.external.coroutine_loop` for built-in components, without pauses."""
    machine, observation, state = loop.plant_state, loop.observation, loop.control_state
    feedforward, total = loop.torques
    period = loop.support.shape[0]
    sample, status, taken = start % period, RUNNING, 0
    if start == 0 and samples.shape[0] > 0:
        status = check(loop.limits, 0, machine)
    while status == RUNNING and taken < samples.shape[0]:
        step = start + taken
        begin(loop.guard, loop.feedforward, step, sample)
        acting = lets_act(loop.guard, loop.start_step, step)
        observe(loop.sensing, loop.mechanism, step, machine, observation)
        if step >= loop.start_step:
            predict(loop.feedforward, loop.guard, step, sample, state.learning_error, feedforward)
        reference = loop.reference[ACTING if acting else BEFORE, sample]
        control(loop.control, state, loop.support[sample], reference, observation)
        guard_torque(loop.guard, sample, feedforward)
        actuate(loop.actuator, step, state.feedback, feedforward, total)
        commit(samples, body_samples, taken, machine, observation, state, feedforward)
        guard_step(loop.guard, sample, loop.support[sample], state, observation)
        advance_plant(loop.plant, machine, total)
        taken += 1
        sample = sample + 1 if sample + 1 < period else 0
        status = check(loop.limits, sample, machine)
    progress[TAKEN], progress[STOP] = taken, status


class CompiledDriver:
    """Runs built-in components; taking no step compiles the program.

    Args:
        loop: all components.
    """

    def __init__(self, loop: Loop):
        self.loop = loop
        self.taken = 0
        """Steps taken so far."""
        self.divergence = ""
        """As of :class:`ExternalDriver`: no built-in plant reports one."""
        self.state = Measurement(*loop.plant_state[:7])
        self.progress = np.zeros(3, dtype=np.int64)
        self.run(*make_samples(0, loop.support.shape[1], False))

    def run(self, samples: Array, body_samples: Array) -> int:
        """As :meth:`ExternalDriver.run`."""
        fused_loop(self.loop, self.progress, self.taken, samples, body_samples)
        self.taken += int(self.progress[TAKEN])
        return int(self.progress[STOP])
