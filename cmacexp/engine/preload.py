"""What workers need, imported by the process that they are copies of."""

import cmacexp.engine.job  # noqa: F401
from cmacexp.jit.forms import njit

njit("int64(int64)")(lambda number: number)  # what numba does at its first program takes longer than many runs
