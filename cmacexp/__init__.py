"""Learned feedforward (CMAC) for hybrid position/force control of legs: Lin & Song 1997 and beyond."""

from typing import TYPE_CHECKING, Any

from cmacexp.data.version import __version__

if TYPE_CHECKING:
    from cmacexp.experiment.api import load, run

__all__ = ["__version__", "load", "run"]
__path__.append(f"{__path__[0]}/commands")  # ``python -m cmacexp.score`` runs commands/score.py


def __getattr__(name: str) -> Any:
    """``run`` and ``load`` of :mod:`cmacexp.experiment.api`, imported when they are first asked for."""
    if name in ("load", "run"):
        from cmacexp.experiment import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
