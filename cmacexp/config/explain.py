"""One-line explanations of why a config could not be composed, with the names that exist."""

import json
import re
from collections.abc import Sequence
from shlex import quote

from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from cmacexp.config.component import find_option, list_options_with
from cmacexp.config.fields import listed
from cmacexp.config.robot_rule import find_mistake
from cmacexp.errors import format_install_command, format_value, suggest

COMPOSITION_ERRORS = (HydraException, OmegaConfBaseException, YAMLError)
"""Errors that Hydra raises deliberately for an invalid config; malformed overrides can raise any other error."""


def explain_composition(error: Exception, overrides: Sequence[str]) -> str:
    """Explain in one line an error that Hydra raised while it composed the config of a command line."""
    if (mistake := find_mistake(error)) is not None:
        return str(mistake)
    text = " ".join(str(error).split())
    if unresolved := re.match(r"Error resolving interpolation '\$\{(\w+)\}'", text):  # written in conf/config.yaml
        return f"{unresolved[1]}=null: must be a group of fields; choose an option of conf/{unresolved[1]}"
    if isinstance(error, MissingConfigException) and error.options is not None:
        return _explain_option(str(error.missing_cfg_file), error.options)
    if isinstance(error, OverrideParseException):
        return _explain_syntax(error)
    if several := re.match(r"Ambiguous value for argument '(.*?)' ", text):
        return f"{several[1]}: several values need -m: python -m cmacexp -m {several[1]}; a list needs brackets"
    # A folder that does not exist any more, or two options that exclude each other.
    if isinstance(error, OSError) or text.startswith("Only one of --"):
        return text
    if not isinstance(error, COMPOSITION_ERRORS):
        return f"a group takes the name of an option (cmac=one_leg), a field takes a value (cmac.layers=8): {text}"
    cause = error.__cause__
    is_missing = "not in" in str(cause)
    if isinstance(cause, OmegaConfBaseException) and is_missing and (cause.full_key or "hydra")[:5] != "hydra":
        return _explain_key(cause, overrides)
    reason = str(cause).splitlines()[0] if str(cause or "") else ""
    return text if reason in text else f"{text} ({reason})"


def _explain_option(path: str, options: Sequence[str]) -> str:
    """Explain that ``path``, GROUP/NAME, is none of the ``options`` of its group."""
    group, separator, name = path.partition("//")  # an absolute path
    group, _, name = (group, "", f"/{name}") if separator else path.rpartition("/")
    if path.startswith("machine/") and name.endswith((".xml", ".urdf")):
        file = path.removeprefix("machine/")
        return f"machine={file}: is no option; for a file use machine=mjcf machine.path={file}"
    if command := format_install_command(path):
        return f"{group}={name}: is not installed: {command}"
    return f"{group}={name}: choose from {', '.join(options)}{suggest(name, options)}"


def _explain_syntax(error: OverrideParseException) -> str:
    """Explain why Hydra cannot parse an override, and how to write it."""
    override = str(error.override)
    reason = str(error).splitlines()[0]
    if override in reason:
        reason = "it does not have the form of an override"
    key, _, value = override.partition("=")
    quoted = quote(f"{key}={json.dumps(format_value(value), ensure_ascii=False)}")
    return (
        f"{format_value(error.override)}: cannot be read ({reason}); write key=value; "
        f"a text with special characters: {quoted}"
    )


def _explain_key(error: OmegaConfBaseException, overrides: Sequence[str]) -> str:
    """List the keys that exist in the group of the missing key of an error."""
    key = str(error.full_key)
    parent = key.rpartition(".")[0]
    names = [str(name) for name in error.parent_node or () if name != "hydra"]
    if not names:
        return f"{key}: no such key; {parent} is a value, not a group"
    if any(text.startswith(f"{parent}._target_=") for text in overrides):
        return f"{key}: the option of conf/{parent} has no such field; add one of a custom class: +{key}=VALUE"
    if options := list_options_with(parent, str(error.key)):
        target = (error.parent_node or {}).get("_target_")
        option = f" with {parent}={find_option(parent, target)}" if target else ""
        return (
            f"{key}: no such key{option}; {listed(options)} of conf/{parent} have it: choose one of these, or leave "
            f"out the key; options with and without it take two sweeps"
        )
    suggestion = suggest(str(error.key), names, f"{parent}." if parent else "")
    return f"{key}: no such key; {parent or 'the config'} has {listed(names)}{suggestion}"
