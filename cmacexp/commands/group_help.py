"""``GROUP=help``: the options of a config group, and its fields with allowed values, unit and meaning."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import Field, fields, is_dataclass
from pathlib import Path
from shutil import get_terminal_size
from types import NoneType
from typing import Any, get_args

import yaml

from cmacexp.cmac.rules import RULES
from cmacexp.config.component import COMPONENTS, config_folder
from cmacexp.config.compose import compose_config
from cmacexp.config.describe import read_meanings
from cmacexp.config.fields import describe_range
from cmacexp.errors import CmacexpError, in_one_line

HELP = "=help"
NAMES = {"rule": RULES}
"""Allowed names of fields that are listed in code instead of the config schema, by field name."""


def describe_allowed(field: "Field[Any]") -> str:
    """Describe the allowed values of a config field in words, with names in backquotes."""
    if names := field.metadata.get("choices") or NAMES.get(field.name):
        words = ", ".join(f"`{name}`" for name in names)
    elif "unit" in field.metadata:
        words = describe_range(dict(field.metadata)).removeprefix("must be ")
    else:
        words = "`true`, `false`" if field.type is bool else "a name"
    return words + (" or `null`" if NoneType in get_args(field.type) else "")


def format_typed(value: object) -> str:
    """Format a value as it is typed on the command line."""
    return yaml.safe_dump(value, default_flow_style=True, width=1000).splitlines()[0]


def describe_option(path: Path) -> str:
    """Return the comment at the top of the YAML file of an option, as one line."""
    lines = [line.removeprefix("# ") for line in path.read_text().splitlines() if line.startswith("#")]
    return " ".join(line for line in lines if not line.startswith("@"))


def find_group(arguments: Sequence[str]) -> str | None:
    """Find the config group in an argument ``GROUP=help``; None without such an argument."""
    names = (text.removesuffix(HELP) for text in arguments if text.endswith(HELP))
    return next((name for name in names if name and (config_folder() / name).is_dir()), None)


def _list_fields(node: Any, prefix: str) -> Iterator[tuple[str, str]]:
    """Yield the fields of a config node and its sub-nodes: ``KEY=VALUE`` as typed, and a description.

    The description consists of the allowed values, the unit and the meaning.
    """
    schema: Any = type(node)
    for field in fields(node):
        key = f"{prefix}.{field.name}"
        value = vars(node)[field.name]
        if is_dataclass(value):
            yield from _list_fields(value, key)
        elif field.name != "_target_":
            allowed = describe_allowed(field).replace("`", "")
            unit = f", in {field.metadata['unit']}" if field.metadata.get("unit") else ""
            described = (f"{allowed}{unit}", read_meanings(schema).get(field.name, ""))
            yield f"{key}={format_typed(value)}", ". ".join(filter(None, described))


def format_help(group: str, arguments: Sequence[str]) -> str:
    """Format the options and fields of a config group, with the values of the run that ``arguments`` describe."""
    width = max(60, get_terminal_size().columns - 1)

    def wrap(text: str, indent: str) -> str:
        return textwrap.fill(in_one_line(text), width, initial_indent=indent, subsequent_indent=indent)

    lines = [f"{group}=OPTION, one of"]
    for path in sorted((config_folder() / group).glob("*.yaml")):
        lines += [f"  {path.stem}", wrap(describe_option(path), "      ")]
    overrides = [text for text in arguments if not text.startswith(("-", "hydra")) and not text.endswith(HELP)]
    try:
        node = vars(compose_config(overrides)).get(group)
    except CmacexpError as error:
        return "\n".join([*lines, f"fields: docs/config.md; they cannot be listed here: {error}"])
    if is_dataclass(node):
        hint = "; for the fields of another option add GROUP=OPTION" if group in (*COMPONENTS, "machine") else ""
        described = [f"  {field}\n{wrap(text, '      ')}" for field, text in _list_fields(node, group)]
        lines += [f"{group}.FIELD=VALUE, with the values of this run{hint}", *described] if described else []
    return "\n".join(lines)
