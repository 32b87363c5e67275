"""What a short run need not wait for: work that libraries do at their start, and that no run uses."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

BLAS = ("scipy.linalg", "scipy.linalg.cython_blas")


@contextmanager
def blas_left_for_later() -> Iterator[None]:
    """Keep numba from importing scipy.linalg, a tenth of a run, only to know that it is there.

    Kernels that call BLAS, which ours do not, import it when they are compiled.
    """
    if any(name in sys.modules for name in BLAS):
        yield
        return
    for name in BLAS:
        sys.modules[name] = ModuleType(name)
    try:
        yield
    finally:
        for name in BLAS:
            del sys.modules[name]
