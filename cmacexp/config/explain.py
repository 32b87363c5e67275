"""Say in one line, with the names that exist, why a config could not be composed."""

import difflib
import re
from collections.abc import Sequence
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config.fields import listed
from cmacexp.config.folder import config_folder
from cmacexp.errors import format_install_command


def _composed(overrides: Sequence[str]) -> DictConfig:
    """The config with the group choices of ``overrides``, as far as they are good, and nothing else changed."""
    GlobalHydra.instance().clear()
    choices = [text for text in overrides if "." not in text.split("=")[0] and not text.startswith(("+", "~", "-"))]
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        kept: list[str] = []
        for text in choices:
            try:
                compose("config", [*kept, text])
                kept.append(text)
            except (HydraException, OmegaConfBaseException):
                continue
        return compose("config", kept)


def _children(node: Any) -> list[str]:
    return sorted(str(key) for key in node) if isinstance(node, DictConfig) else []


def unknown_key(key: str, overrides: Sequence[str]) -> str:
    """Name what exists where ``key`` does not, and the nearest of it."""
    parts, node, parent = key.split("."), _composed(overrides), ""
    for part in parts:
        if not isinstance(node, DictConfig) or part not in node:
            break
        parent = f"{parent}.{part}" if parent else part
        node = OmegaConf.select(node, part)
    names = _children(node)
    wrong = key[len(parent) + 1 if parent else 0 :]
    if not names:
        return f"{key}: no such key; {parent} is a value and holds no other keys"
    if any(text.startswith(f"{parent}._target_=") for text in overrides):
        return f"{key}: the option of conf/{parent} has no such field; add one of a class of your own: +{key}=VALUE"
    near = difflib.get_close_matches(wrong.split(".")[0], names, 1)
    meant = f"; did you mean {parent + '.' if parent else ''}{near[0]}?" if near else ""
    return f"{key}: no such key; {parent or 'the config'} has {listed(names)}{meant}"


def explain_composition(error: Exception, overrides: Sequence[str]) -> str:
    """One line for what Hydra says in several.

    Args:
        error: what Hydra raised while it composed.
        overrides: the command line.
    """
    cause = error.__cause__
    if unresolved := re.match(r"Error resolving interpolation '\$\{(\w+)\}'", str(error)):  # of conf/config.yaml
        return f"{unresolved[1]}=None: must be a group of fields; choose an option of conf/{unresolved[1]}"
    if isinstance(error, MissingConfigException) and error.options is not None:
        group, _, name = str(error.missing_cfg_file).rpartition("/")
        if command := format_install_command(str(error.missing_cfg_file)):
            return f"{group}={name}: is not installed: {command}"
        near = difflib.get_close_matches(name, error.options, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        return f"{group}={name}: choose from {', '.join(error.options)}{meant}"
    if isinstance(error, OverrideParseException):
        return (
            f"{error.override}: cannot be read ({str(error).splitlines()[0]}); write key=value, quoted for the shell"
        )
    if isinstance(cause, OmegaConfBaseException) and "not in" in str(cause):
        key = str(cause.full_key or "")
        if key and not key.startswith("hydra"):
            return unknown_key(key, overrides)
    return " ".join(str(error).split()) + (f" ({str(cause).splitlines()[0]})" if cause else "")
