"""``learning.lead=estimate``: the feedback delay, estimated from the response to a small probing torque.

The torque is added for some cycles without learning, with a sign that changes from cycle to cycle so that the
feedback of the walk itself cancels out. The torque changes made by learning would not serve as a probe: they repeat
the sensor noise from which they were learnt, and the change of the feedback contains the same noise.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array, Clock

CYCLES = 8
"""Cycles over which the response is averaged; a multiple of 4, so that linear trends cancel out too."""
FIRST_LEARNING = 3 + CYCLES
"""Earliest cycle in which learning begins, counted from 1."""
SHARE = 0.1
"""Ratio of the RMS probing torque to the RMS learning error with feedback only."""
ARRIVED_SHARE = 0.75
"""Share of its peak at which the response has arrived; from 0.6 to 0.9 equally many leads are correct."""
CLEAR = 4.0
"""Peak of the response in standard deviations of a random one above which the estimate is accepted."""
LONGEST = 100
"""Longest lead that is searched, samples; at most a quarter of the cycle."""
MOST_PROBES = 4
"""Largest number of probes in a run."""


class ProbeState(NamedTuple):
    """State shared by the loop and a probe, for cycles of N samples and L legs with J joints."""

    pattern: Array
    """(N, L, J): random signs, +1 or -1."""
    response: Clock
    """(N, L, J): mean over cycles of the learning errors times the sign of their cycle, N m."""
    sign: Clock
    """(1,): sign of the torque in this cycle; 0: no torque is added."""
    amplitude: Clock
    """(1,): amplitude of the torque, N m."""


@kernel
def add_probe(probe: ProbeState | None, sample: int, torque: Array) -> None:
    """Add the probing torque to the ``torque`` (L, J) of a step, N m."""
    if probe is not None and probe.sign[0] != 0.0:
        amplitude = probe.sign[0] * probe.amplitude[0]
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                torque[i, j] += amplitude * probe.pattern[sample, i, j]


@kernel
def note_response(probe: ProbeState | None, sample: int, learning_error: Array) -> None:
    """Add the ``learning_error`` (L, J) of a step, N m, to the response."""
    if probe is not None and probe.sign[0] != 0.0:
        share = probe.sign[0] / CYCLES
        for i in range(learning_error.shape[0]):
            for j in range(learning_error.shape[1]):
                probe.response[sample, i, j] += share * learning_error[i, j]


class LeadProbe:
    """Probes of the feedback delay: one before learning and one after each reversion, at most MOST_PROBES.

    Attributes:
        state: arrays shared with the loop; None if the lead is not estimated.
        waits: True if a probe begins with the next cycle of feedback only or of a repeated torque.
        cycles_left: remaining cycles of the present probe; 0 without one.
        ended: number of completed probes.
    """

    def __init__(self, samples: int, shape: tuple[int, int], seed: int | None):
        """Prepare probes for cycles of ``samples`` steps and ``shape`` (L, J).

        ``seed`` determines the random pattern; None: no probes.
        """
        self.state: ProbeState | None = None
        self.waits = seed is not None
        self.cycles_left = self.ended = 0
        if seed is not None:
            pattern = np.random.default_rng(seed).choice([-1.0, 1.0], (samples, *shape))
            self.state = ProbeState(pattern, np.zeros_like(pattern), np.zeros(1), np.zeros(1))

    @property
    def is_idle(self) -> bool:
        """True if no probe waits or is in progress."""
        return not self.waits and self.cycles_left == 0

    def begin(self, effort: float) -> bool:
        """Begin a waiting probe and return True; return False if none waits.

        ``effort`` is the root of the sum of squared learning errors over a cycle with feedback only, N m.
        """
        if self.state is None or not self.waits:
            return False
        self.state.response[...] = 0.0
        self.state.amplitude[0] = SHARE * effort / self.state.response.size**0.5
        self.waits = False
        self.cycles_left = CYCLES
        self._choose_sign(self.state)
        return True

    def end_cycle(self) -> bool:
        """Count a cycle of the present probe; return True if the probe ends with it."""
        if self.state is None or self.cycles_left == 0:
            return False
        self.cycles_left -= 1
        self._choose_sign(self.state)
        self.ended += self.cycles_left == 0
        return self.cycles_left == 0

    def _choose_sign(self, state: ProbeState) -> None:
        """Set the sign of the torque for the coming cycle, in the sequence + - - + and so on."""
        state.sign[0] = 0.0 if self.cycles_left == 0 else 1.0 if self.cycles_left % 4 < 2 else -1.0

    def repeat(self, clear: bool) -> None:
        """Cancel the present probe after a reversion, and schedule another one if any are left.

        ``clear`` is False if the feedback chatters, which hides the response. No probe follows
        if none has been completed.
        """
        self.waits = clear and 0 < self.ended < MOST_PROBES
        self.cycles_left = 0
        if self.state is not None:
            self._choose_sign(self.state)


def estimate_lead(probe: ProbeState, on_drives: bool = False) -> int | None:
    """Estimate the lead, in samples, as the lag at which the response of all joints together has arrived.

    Returns None if the response is not significant. It has arrived at the first lag with ARRIVED_SHARE of its peak.
    With position loops in the drives (``on_drives``) joints respond according to their inertia, joints of swing legs
    last, so that the plateau is wide: the lag of the peak is a suitable lead for all of them.

    The response at a lag is the correlation of feedback and pattern. Without a true response its standard deviation
    is the root of the sum of squared feedback, since the pattern consists of random signs.
    """
    lags = range(1, 1 + min(LONGEST, len(probe.pattern) // 4))
    correlation = np.array([-(np.roll(probe.response, -lag, axis=0) * probe.pattern).sum() for lag in lags])
    if correlation.max() <= CLEAR * np.linalg.norm(probe.response):
        return None
    if on_drives:
        return lags[int(correlation.argmax())]
    return lags[int(np.flatnonzero(correlation >= ARRIVED_SHARE * correlation.max())[0])]
