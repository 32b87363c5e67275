"""Learning from an error at neighbouring steps too, which filters it over time by a low-pass without phase."""

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array, Cells

MOST_ENTRIES = 2**27
"""Largest number of active weights, over all steps of a cycle and their neighbours, in :func:`spread_shares`."""


def binomial(window: int) -> Array:
    """Taps (2 x window + 1,), without a unit, of the binomial filter; their sum is 1.

    Its gain at frequency f is cos(pi f T_s)^(2 x window), which is never negative and has no side lobes: it reverses
    no error and attenuates fast ones.
    """
    taps = np.ones(1)
    for _ in range(2 * window):
        taps = np.convolve(taps, [0.5, 0.5])
    return taps


def spread_shares(cells: Cells, activation: Array, window: int) -> tuple[Cells, Array]:
    """Weights that learn from the error of each sample, and their shares, (N, L, K) each.

    ``cells`` (N, L, C) are the active weights of each sample of the cycle, with their ``activation``; ``window`` is
    that of samples on each side. The share of a weight is the sum of g_m a_j / sum a_i^2 over the neighbouring
    samples in which it is active; zeros follow the last one. Raises BadInput if the window is wider than the cycle,
    or gives too many weights.
    """
    samples, legs, active = cells.shape
    if 2 * window + 1 > samples:
        raise BadInput("learning.window", window, f"must be below {(samples + 1) // 2}, half the samples of a cycle")
    if cells.size * (2 * window + 1) > MOST_ENTRIES:
        allowed = f"must be below {MOST_ENTRIES // (2 * cells.size)} with this network"
        raise BadInput("learning.window", window, allowed)
    power = (activation**2).sum(axis=2, keepdims=True)
    share = np.divide(activation, power, out=np.zeros_like(activation), where=power > 0.0)
    taps = np.repeat(binomial(window), active)
    found = []
    for k in range(samples):
        around = np.arange(k - window, k + window + 1) % samples
        for i in range(legs):
            rows, place = np.unique(cells[around, i], return_inverse=True)
            total = np.bincount(place.ravel(), taps * share[around, i].ravel())
            found.append((rows[total > 0.0], total[total > 0.0]))
    most = max(1, *(len(rows) for rows, _ in found))
    shape = (samples * legs, most)
    spread_cells, shares = np.zeros(shape, dtype=cells.dtype), np.zeros(shape)
    for n, (rows, total) in enumerate(found):
        spread_cells[n, : len(rows)], shares[n, : len(rows)] = rows, total
    return spread_cells.reshape(samples, legs, most), shares.reshape(samples, legs, most)


@kernel(inline=False)
def train_spread(weights: Array, cells: Cells, share: Array, error: Array, rate: float, leakage: float) -> None:
    """Add beta s_j (U - leakage W_j) to every weight that learns from the error.

    Changes the rows ``cells`` (K,) of ``weights`` (rows, outputs) by their ``share`` (K,), s_j, of which the first
    zero marks the end, of ``error`` (outputs,), U, N m. ``leakage`` is that of one weight: C times that of an output,
    which is the sum of C equal weights.
    """
    for j in range(cells.shape[0]):
        if share[j] == 0.0:
            return
        for o in range(error.shape[0]):
            weight = weights[cells[j], o]
            weights[cells[j], o] = weight + rate * share[j] * (error[o] - leakage * weight)
