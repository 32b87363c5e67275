"""Typed and checked configuration of a run."""

from cmacexp.config.component import ComponentConfig, FeedforwardConfig, config_folder
from cmacexp.config.fields import choice, number
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
    "to_config",
    "to_plain",
]
