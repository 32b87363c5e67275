"""White noise out of counters: the same in every process, in any order, compiled or not."""

from cmacexp.jit.compiler import kernel
from cmacexp.models.mix import MASK, mix

SUMMED = 12
"""Uniform numbers of 16 bits in one normal number: their variance adds up to 1."""


@kernel
def uniform(key: int, step: int) -> float:
    """A number from 0 to 1 that ``key`` and ``step`` fix."""
    return mix(mix(mix(key, step), step), 1) / MASK


@kernel
def normal(key: int, step: int) -> float:
    """A number of mean 0 and variance 1 that ``key`` and ``step`` fix.

    The sum of twelve uniform numbers, which never leaves 6 standard deviations: it takes no logarithm, whose last
    bit is not the same everywhere.
    """
    state = mix(mix(key, step), step)
    total = 0
    for _ in range(SUMMED // 2):
        state = mix(state, 1)
        total += (state & 0xFFFF) + (state >> 16)
    return (total - SUMMED * 0x7FFF - SUMMED // 2) / 65536.0
