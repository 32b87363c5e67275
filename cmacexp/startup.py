"""What a short run need not wait for: work that libraries do at their start, and that no run uses."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import ModuleType

BLAS = ("scipy.linalg", "scipy.linalg.cython_blas")


def compose_once(arguments: Sequence[str]) -> None:
    """Keep Hydra from composing the whole config a first time only to read ``hydra.mode`` in it.

    No shipped config sets it; where the command line could bring it in, Hydra looks as ever.
    """
    from hydra._internal.hydra import Hydra

    if not any("hydra.mode" in text or text.startswith(("-cd", "-cn", "-cp", "--config-")) for text in arguments):
        Hydra.get_mode = lambda self, config_name, overrides: None  # type: ignore[method-assign, assignment]


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
