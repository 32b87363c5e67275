"""``GROUP=help``: the options of a group of the config, and its fields with unit, allowed values and meaning."""

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
"""Names that a field takes, where they are a table of the code and not of the config."""


def describe_allowed(field: "Field[Any]") -> str:
    """The values that a field takes, in words; names in backquotes."""
    if names := field.metadata.get("choices") or NAMES.get(field.name):
        words = ", ".join(f"`{name}`" for name in names)
    elif "unit" in field.metadata:
        words = describe_range(dict(field.metadata)).removeprefix("must be ")
    else:
        words = "`true`, `false`" if field.type is bool else "a name"
    return words + (" or `null`" if NoneType in get_args(field.type) else "")


def format_typed(value: object) -> str:
    """A value as it is typed."""
    return yaml.safe_dump(value, default_flow_style=True, width=1000).splitlines()[0]


def describe_option(path: Path) -> str:
    """What the comment at the beginning of an option says."""
    lines = [line.removeprefix("# ") for line in path.read_text().splitlines() if line.startswith("#")]
    return " ".join(line for line in lines if not line.startswith("@"))


def find_group(arguments: Sequence[str]) -> str | None:
    """The group that ``GROUP=help`` among the arguments of a command line names; None without it."""
    named = (text.removesuffix(HELP) for text in arguments if text.endswith(HELP))
    return next((name for name in named if name and (config_folder() / name).is_dir()), None)


def _list_fields(node: Any, prefix: str) -> Iterator[tuple[str, str]]:
    """The fields of a node as they are typed, and what is known of each; of nodes inside it likewise."""
    schema: Any = type(node)
    for field in fields(node):
        value, key = vars(node)[field.name], f"{prefix}.{field.name}"
        if is_dataclass(value):
            yield from _list_fields(value, key)
        elif field.name != "_target_":
            allowed, unit = describe_allowed(field).replace("`", ""), field.metadata.get("unit", "")
            known = (f"{allowed}, in {unit}" if unit else allowed, read_meanings(schema).get(field.name, ""))
            yield f"{key}={format_typed(value)}", ". ".join(filter(None, known))


def format_help(group: str, arguments: Sequence[str]) -> str:
    """Options and fields of a group; values are those of the run that the other ``arguments`` describe."""
    width = max(60, get_terminal_size().columns - 1)

    def fill(text: str, indent: str) -> str:
        return textwrap.fill(in_one_line(text), width, initial_indent=indent, subsequent_indent=indent)

    lines = [f"{group}=OPTION, one of"]
    for path in sorted((config_folder() / group).glob("*.yaml")):
        lines += [f"  {path.stem}", fill(describe_option(path), "      ")]
    others = [text for text in arguments if not text.startswith(("-", "hydra")) and not text.endswith(HELP)]
    try:
        node = vars(compose_config(others)).get(group)
    except CmacexpError as error:
        return "\n".join([*lines, f"fields: docs/config.md; they cannot be listed here: {error}"])
    if is_dataclass(node):
        own = " of another option: add GROUP=OPTION" if group in (*COMPONENTS, "machine") else ""
        found = [f"  {typed}\n{fill(known, '      ')}" for typed, known in _list_fields(node, group)]
        lines += [f"{group}.FIELD=VALUE, values as in this run;{own}".rstrip(";"), *found] if found else []
    return "\n".join(lines)
