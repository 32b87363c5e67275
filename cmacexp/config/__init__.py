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
_PLACES = {
    **dict.fromkeys(("ComponentConfig", "FeedforwardConfig", "config_folder"), "component"),
    **dict.fromkeys(("choice", "number", "read_fields"), "fields"),
    **dict.fromkeys(("config_hash", "to_config", "to_plain"), "load"),
    "Config": "schema",
}


def __getattr__(name: str) -> Any:
    """A public name, imported when it is first asked for: :class:`cmacexp.cmac.Cmac` needs no Hydra."""
    if name in _PLACES:
        return getattr(import_module(f"cmacexp.config.{_PLACES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
