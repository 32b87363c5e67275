"""Typed and checked configuration of a run."""

from cmacexp.config.load import config_folder, config_hash, to_config, to_plain
from cmacexp.config.schema import Config

__all__ = ["Config", "config_folder", "config_hash", "to_config", "to_plain"]
