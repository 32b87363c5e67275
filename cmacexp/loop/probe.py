"""``learning.lead=estimate``: the delay of the feedback, from its response to a small known torque.

While nothing learns, the torque is added for some cycles, with a sign that changes from cycle to cycle so that the
feedback of the walk cancels out. What learning itself changes would not do: it repeats the noise of the sensors that
it learnt from, and the change of the feedback contains the same noise.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array, Clock

CYCLES = 8
"""Cycles over which the response is averaged; a multiple of 4, so that what rises steadily cancels out too."""
FIRST_LEARNING = 3 + CYCLES
"""Cycle in which learning begins at the earliest, from 1."""
SHARE = 0.1
"""Root mean square of the torque, over that of feedback only."""
ARRIVED_SHARE = 0.75
"""Share of its largest value at which the response has arrived: from 0.6 to 0.9 equally many leads are right."""
CLEAR = 4.0
"""Response to the torque over what chance gives, by standard deviations, above which it shows the delay."""
LONGEST = 100
"""Lead that is looked for at most, samples, and a quarter of the cycle."""
MOST_PROBES = 4
"""Most probes of one run."""


class ProbeState(NamedTuple):
    """The part of a probe that the loop sees, over a cycle of N samples of L legs with J joints."""

    pattern: Array
    """(N, L, J): +1 or -1, by chance."""
    response: Clock
    """(N, L, J): mean of the learning errors, each times the sign of its cycle, N m."""
    sign: Clock
    """(1,): of the torque in this cycle; 0: none is added."""
    amplitude: Clock
    """(1,): of the torque, N m."""


@kernel
def add_probe(probe: ProbeState | None, sample: int, torque: Array) -> None:
    """Add the torque of a probe to ``torque`` (L, J) of a step, N m."""
    if probe is not None and probe.sign[0] != 0.0:
        amplitude = probe.sign[0] * probe.amplitude[0]
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                torque[i, j] += amplitude * probe.pattern[sample, i, j]


@kernel
def note_response(probe: ProbeState | None, sample: int, learning_error: Array) -> None:
    """Add the learning errors (L, J) of a step, N m, to the response."""
    if probe is not None and probe.sign[0] != 0.0:
        share = probe.sign[0] / CYCLES
        for i in range(learning_error.shape[0]):
            for j in range(learning_error.shape[1]):
                probe.response[sample, i, j] += share * learning_error[i, j]


class LeadProbe:
    """Probes of the feedback, one before learning and one after each retreat, until MOST_PROBES have ended.

    Attributes:
        state: what the loop sees of it; None: there are none.
        waits: whether one is to begin with the next cycle of feedback or of a repeated torque.
        cycles_left: of the one that is under way; 0: none is.
        ended: number of those that have ended.
    """

    def __init__(self, samples: int, shape: tuple[int, int], seed: int | None):
        """``samples`` of a cycle, ``shape`` (L, J), ``seed`` of the pattern; None: nothing is probed."""
        self.state: ProbeState | None = None
        self.waits = seed is not None
        self.cycles_left = self.ended = 0
        if seed is not None:
            pattern = np.random.default_rng(seed).choice([-1.0, 1.0], (samples, *shape))
            self.state = ProbeState(pattern, np.zeros_like(pattern), np.zeros(1), np.zeros(1))

    @property
    def is_idle(self) -> bool:
        """Whether none waits or is under way."""
        return not self.waits and self.cycles_left == 0

    def begin(self, effort: float) -> bool:
        """Begin one if it waits; ``effort``: of feedback only, root of its summed squares over a cycle, N m."""
        if self.state is None or not self.waits:
            return False
        self.state.response[...] = 0.0
        self.state.amplitude[0] = SHARE * effort / self.state.response.size**0.5
        self.waits, self.cycles_left = False, CYCLES
        self._choose_sign(self.state)
        return True

    def end_cycle(self) -> bool:
        """Whether one has ended with the cycle that has ended."""
        if self.state is None or self.cycles_left == 0:
            return False
        self.cycles_left -= 1
        self._choose_sign(self.state)
        self.ended += self.cycles_left == 0
        return self.cycles_left == 0

    def _choose_sign(self, state: ProbeState) -> None:
        """The sign of the torque in the cycle that begins: + - - + and so on."""
        state.sign[0] = 0.0 if self.cycles_left == 0 else 1.0 if self.cycles_left % 4 < 2 else -1.0

    def repeat(self, clear: bool) -> None:
        """Let another one wait after a retreat, if that makes sense, ``clear``, and some have ended but not all."""
        self.waits, self.cycles_left = clear and 0 < self.ended < MOST_PROBES, 0
        if self.state is not None:
            self._choose_sign(self.state)


def estimate_lead(probe: ProbeState, on_drives: bool = False) -> int | None:
    """The lead in samples: how much later the response has arrived, over all joints together; None: it is not clear.

    It arrives with the first lag of its plateau, ARRIVED_SHARE of its largest value or more. With loops in the drives
    (``on_drives``) joints respond by their inertia, those of legs in the air last, so that the plateau is wide: the
    lag of its largest value is a lead for all of them.

    The response at a lag is the correlation of feedback and torque, whose standard deviation by chance is the root of
    the summed squares of the feedback, since the pattern is +1 or -1.
    """
    lags = range(1, 1 + min(LONGEST, len(probe.pattern) // 4))
    spared = np.array([-(np.roll(probe.response, -lag, axis=0) * probe.pattern).sum() for lag in lags])
    if spared.max() <= CLEAR * np.linalg.norm(probe.response):
        return None
    if on_drives:
        return lags[int(spared.argmax())]
    return lags[int(np.flatnonzero(spared >= ARRIVED_SHARE * spared.max())[0])]
