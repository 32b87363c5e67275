"""Learned feedforward (CMAC) for hybrid position/force control of legs: Lin & Song 1997 and beyond."""

from typing import TYPE_CHECKING, Any

from cmacexp.data.version import __version__

if TYPE_CHECKING:
    from cmacexp.experiment.api import load, run
    from cmacexp.experiment.sweep_table import load_sweep

__all__ = ["__version__", "load", "load_sweep", "run"]
__path__.append(f"{__path__[0]}/commands")  # ``python -m cmacexp.score`` runs commands/score.py


def __getattr__(name: str) -> Any:
    """``run``, ``load`` and ``load_sweep`` of :mod:`cmacexp.experiment`, imported when they are first asked for."""
    if name in ("load", "load_sweep", "run"):
        from cmacexp.experiment import api, sweep_table

        return getattr(sweep_table if name == "load_sweep" else api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
