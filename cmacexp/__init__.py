"""Learned feedforward (CMAC) for hybrid position/force control of legs: Lin & Song 1997 and beyond."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cmacexp.data.version import __version__

if TYPE_CHECKING:
    from cmacexp.engine.api import Run, load, open_loop, run
    from cmacexp.engine.batch import load_sweep, run_many

__all__ = ["Run", "__version__", "load", "load_sweep", "open_loop", "run", "run_many"]
__path__.append(f"{__path__[0]}/commands")  # ``python -m cmacexp.score`` runs commands/score.py
_PLACES = {
    **dict.fromkeys(("Run", "load", "open_loop", "run"), "api"),
    **dict.fromkeys(("load_sweep", "run_many"), "batch"),
}


def __getattr__(name: str) -> Any:
    """A function of :mod:`cmacexp.engine`, or the room ``gym``, imported when it is first asked for."""
    if name in _PLACES:
        return getattr(import_module(f"cmacexp.engine.{_PLACES[name]}"), name)
    if name == "gym":
        return import_module("cmacexp.gym")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All public names, also those that are not imported yet."""
    return [*__all__, "gym"]
