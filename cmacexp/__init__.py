"""Learned feedforward (CMAC) for hybrid position/force control of legs: Lin & Song 1997 and beyond."""

from cmacexp.jit.keyboard import begin_command

begin_command()  # before what follows is imported, which takes as long as all before
__path__.append(f"{__path__[0]}/commands")  # ``python -m cmacexp.score`` runs commands/score.py

from typing import TYPE_CHECKING, Any  # noqa: E402

from cmacexp.data.version import __version__  # noqa: E402

if TYPE_CHECKING:
    from cmacexp.experiment.api import load, run

__all__ = ["__version__", "load", "run"]


def __getattr__(name: str) -> Any:
    """``run`` and ``load`` of :mod:`cmacexp.experiment.api`, imported when they are first asked for."""
    if name in ("load", "run"):
        from cmacexp.experiment import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
