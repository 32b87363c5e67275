"""Learned feedforward (CMAC) for hybrid position/force control of legs: Lin & Song 1997 and beyond."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cmacexp.data.version import __version__

if TYPE_CHECKING:
    from cmacexp.engine.api import Run, load, open_loop, run
    from cmacexp.engine.batch import run_many, write_many
    from cmacexp.engine.sweep_tables import load_sweep
    from cmacexp.errors import BadInput, BadRun, CmacexpError
    from cmacexp.protocols import Controller, Feedforward, Plant, Sensors

__all__ = [
    "BadInput",
    "BadRun",
    "CmacexpError",
    "Controller",
    "Feedforward",
    "Plant",
    "Run",
    "Sensors",
    "__version__",
    "load",
    "load_sweep",
    "open_loop",
    "run",
    "run_many",
    "write_many",
]
_MODULES = {
    **dict.fromkeys(("BadInput", "BadRun", "CmacexpError"), "errors"),
    **dict.fromkeys(("Run", "load", "open_loop", "run"), "engine.api"),
    **dict.fromkeys(("run_many", "write_many"), "engine.batch"),
    "load_sweep": "engine.sweep_tables",
    "Controller": "protocols",
    "Feedforward": "protocols",
    "Plant": "protocols",
    "Sensors": "protocols",
}
"""Module of each public name; it is imported on first use, so that ``import cmacexp`` is fast."""
_SUBMODULES = ("cmac", "control", "feedforward", "gym", "plants", "sensors", "study")
"""Public modules, also imported on first use."""


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(f"cmacexp.{_MODULES[name]}"), name)
    if name in _SUBMODULES:
        return import_module(f"cmacexp.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """List all public names, including those that are not imported yet."""
    return sorted([*__all__, *_SUBMODULES])
