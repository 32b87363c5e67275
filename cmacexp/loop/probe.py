"""``learning.lead=estimate``: how late feedback is, from its response to a small known torque.

While nothing learns, the torque is added for some cycles, with a sign that changes from cycle to cycle so that the
feedback of the walk cancels out. What learning itself changes would not do: it repeats the noise of the sensors that
it learnt from, and the change of the feedback contains the same noise.
"""

from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import CLOCK, Array, Clock, Counts

CYCLES = 8
"""Over which the response is averaged; a multiple of 4, so that what rises steadily cancels out too."""
FIRST_LEARNING = 3 + CYCLES
"""Cycle in which learning begins at the earliest, from 1."""
SHARE = 0.1
"""Root mean square of the torque, over that of feedback alone."""
ARRIVED_SHARE = 0.75
"""Share of its largest value at which the response has arrived: from 0.6 to 0.9 equally many leads are right."""
CLEAR = 4.0
"""Response to the torque over what chance gives, by standard deviations, from which on it shows how late it is."""
LONGEST = 100
"""Lead that is looked for at most, samples, and a quarter of the cycle."""
MOST_PROBES = 4
"""Of one run."""
WAITING, DONE = -1, 0
CYCLES_LEFT, PROBED, LEARN_AGAIN = range(3)
"""Counters: cycles left, WAITING before a probe, DONE after it; probes that have ended; whether to learn again."""


class Probe(NamedTuple):
    """A probe of the feedback, over a cycle of N samples of L legs with J joints; without samples there is none."""

    torque: Array
    """(N, L, J): +1 or -1, by chance."""
    response: Clock
    """(N, L, J): of the learning errors to ``torque``, N m."""
    amplitude: Clock
    """(1,): of the torque, N m."""
    counts: Annotated[Counts, CLOCK]
    """(3,): counters."""


class LeadEstimate(NamedTuple):
    """What a probe gave; its fields are an entry of the manifest."""

    cycle: int
    """Before which it ended, from 1."""
    lead: int
    """Samples; where the response was not clear that of ``auto``, or after a retreat one more than before."""


def new_probe(samples: int, shape: tuple[int, int], seed: int) -> Probe:
    """A probe that waits; ``samples`` of the cycle, 0 for none, and ``shape`` (L, J)."""
    torque = np.random.default_rng(seed).choice([-1.0, 1.0], (samples, *shape))
    return Probe(torque, np.zeros_like(torque), np.zeros(1), np.array([WAITING if samples else DONE, 0, 0]))


@kernel
def sign(cycles_left: int) -> float:
    """Of the torque in a cycle: + - - + and so on."""
    return 1.0 if cycles_left % 4 < 2 else -1.0


@kernel
def add_torque(probe: Probe, sample: int, torque: Array) -> None:
    """Add the torque of a step to ``torque`` (L, J), N m."""
    if probe.counts[CYCLES_LEFT] > 0:
        amplitude = sign(probe.counts[CYCLES_LEFT]) * probe.amplitude[0]
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                torque[i, j] += amplitude * probe.torque[sample, i, j]


@kernel
def note_response(probe: Probe, sample: int, learning_error: Array) -> None:
    """Note the learning errors (L, J) of a step, N m; the probe ends with the last step of its last cycle."""
    if probe.counts[CYCLES_LEFT] > 0:
        share = sign(probe.counts[CYCLES_LEFT]) / CYCLES
        for i in range(learning_error.shape[0]):
            for j in range(learning_error.shape[1]):
                probe.response[sample, i, j] += share * learning_error[i, j]
        if sample == probe.response.shape[0] - 1:
            probe.counts[CYCLES_LEFT] -= 1
            probe.counts[PROBED] += 1 if probe.counts[CYCLES_LEFT] == DONE else 0


@kernel
def begin_probe(probe: Probe, effort: float) -> bool:
    """Begin a probe that waits; ``effort``: of feedback alone, root of its summed squares over a cycle, N m."""
    if probe.counts[CYCLES_LEFT] != WAITING:
        return False
    for k in range(probe.response.shape[0]):
        for i in range(probe.response.shape[1]):
            for j in range(probe.response.shape[2]):
                probe.response[k, i, j] = 0.0
    probe.amplitude[0] = SHARE * effort / probe.response.size**0.5
    probe.counts[CYCLES_LEFT] = CYCLES
    return True


def estimate_lead(probe: Probe) -> int | None:
    """The lead in samples: how much later the response has arrived, over all joints together; None: it is not clear.

    The response at a lag is the correlation of feedback and torque, whose standard deviation by chance is the root of
    the summed squares of the feedback, since the torque is +1 or -1.
    """
    lags = range(1, 1 + min(LONGEST, len(probe.torque) // 4))
    spared = np.array([-(np.roll(probe.response, -lag, axis=0) * probe.torque).sum() for lag in lags])
    if spared.max() <= CLEAR * np.linalg.norm(probe.response):
        return None
    return lags[int(np.argmax(spared >= ARRIVED_SHARE * spared.max()))]
