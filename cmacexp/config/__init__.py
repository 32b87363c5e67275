"""Typed and checked configuration of a run."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmacexp.config.component import ComponentConfig as ComponentConfig
    from cmacexp.config.component import FeedforwardConfig as FeedforwardConfig
    from cmacexp.config.component import config_folder as config_folder
    from cmacexp.config.fields import choice as choice
    from cmacexp.config.fields import number as number
    from cmacexp.config.fields import read_fields as read_fields
    from cmacexp.config.load import config_hash as config_hash
    from cmacexp.config.load import to_config as to_config
    from cmacexp.config.load import to_plain as to_plain
    from cmacexp.config.schema import Config as Config

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
