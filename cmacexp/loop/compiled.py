"""The driver for built-in components: all steps in one compiled program."""

import numpy as np

from cmacexp.jit.compiler import program
from cmacexp.loop.samples import make_samples
from cmacexp.loop.step import STOP, TAKEN, Loop, take_fused_steps
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array

fused_loop = program(take_fused_steps)


class CompiledDriver:
    """Runs built-in components; taking no step compiles the program."""

    def __init__(self, loop: Loop):
        self.loop = loop
        self.taken = 0
        """Steps taken so far."""
        self.divergence = ""
        """As of :class:`ExternalDriver`; a built-in plant knows its own."""
        self.state = Measurement(*loop.plant_state[:7])
        self.progress = np.zeros(3, dtype=np.int64)
        self.run(*make_samples(0, loop.support.shape[1], False))

    def run(self, samples: Array, body_samples: Array) -> int:
        """As :meth:`ExternalDriver.run`."""
        fused_loop(self.loop, self.progress, self.taken, samples, body_samples)
        self.taken += int(self.progress[TAKEN])
        return int(self.progress[STOP])
