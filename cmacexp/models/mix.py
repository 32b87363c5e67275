"""Mixing of integers into 32 bits, for hashes and random numbers that are the same in every process."""

from cmacexp.jit.compiler import kernel

MULTIPLIER = 0x5BD1E995
"""An odd 31-bit number, so that its product with 32 bits stays within a signed 64-bit integer."""
MASK = 0xFFFFFFFF


@kernel
def mix(state: int, value: int) -> int:
    """Mix ``value`` into a 32-bit ``state`` by multiplication and shift, in integers that never overflow."""
    state = ((state ^ value) * MULTIPLIER) & MASK
    return state ^ (state >> 15)
