"""White noise computed from counters: equal in every process, in any order, compiled or not."""

from cmacexp.jit.compiler import kernel
from cmacexp.models.mix import MASK, mix

SUMMED = 12
"""Uniform 16-bit numbers whose sum is one normal number: their variances sum up to 1."""


@kernel
def uniform(key: int, step: int) -> float:
    """A number from 0 to 1, determined by ``key`` and ``step``."""
    return mix(mix(mix(key, step), step), 1) / MASK


@kernel
def normal(key: int, step: int) -> float:
    """A number of mean 0 and variance 1, determined by ``key`` and ``step``.

    It is the sum of twelve uniform numbers, so it stays within 6 standard deviations. A logarithm is avoided, since
    its last bit differs between platforms.
    """
    state = mix(mix(key, step), step)
    total = 0
    for _ in range(SUMMED // 2):
        state = mix(state, 1)
        total += (state & 0xFFFF) + (state >> 16)
    return (total - SUMMED * 0x7FFF - SUMMED // 2) / 65536.0
