"""What compiles kernels, and the rooms whose sources key the cache of compiled code and the hash of a run."""

from cmacexp.jit.compiler import program as program
from cmacexp.jit.sources import KERNEL_ROOMS as KERNEL_ROOMS
from cmacexp.jit.sources import RESULT_ROOMS as RESULT_ROOMS
