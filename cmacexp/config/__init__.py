"""Typed and checked configuration of a run."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmacexp.config.component import ComponentConfig, FeedforwardConfig, config_folder
    from cmacexp.config.fields import choice, number, read_fields
    from cmacexp.config.load import config_hash, to_config, to_plain
    from cmacexp.config.schema import Config

__all__ = [
    "ComponentConfig",
    "Config",
    "FeedforwardConfig",
    "choice",
    "config_folder",
    "config_hash",
    "number",
    "read_fields",
    "to_config",
    "to_plain",
]
_MODULES = {
    **dict.fromkeys(("ComponentConfig", "FeedforwardConfig", "config_folder"), "component"),
    **dict.fromkeys(("choice", "number", "read_fields"), "fields"),
    **dict.fromkeys(("config_hash", "to_config", "to_plain"), "load"),
    "Config": "schema",
}


def __getattr__(name: str) -> Any:
    """Import a public name on first access, so that :class:`cmacexp.cmac.Cmac` does not load Hydra."""
    if name in _MODULES:
        return getattr(import_module(f"cmacexp.config.{_MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
