"""Rooms whose sources key the cache of compiled code, and the hash of a run, of the room ``jit``."""

from cmacexp.jit.sources import KERNEL_ROOMS as KERNEL_ROOMS
from cmacexp.jit.sources import RESULT_ROOMS as RESULT_ROOMS
