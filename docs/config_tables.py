"""The tables of the page config.md: every field as its class declares it, with the defaults that conf/ gives.

mkdocs fills the page when it builds the site, so an addition to the config needs no edit of it.
"""

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from cmacexp.commands.group_help import describe_allowed, describe_option, format_typed
from cmacexp.config import Config, to_config
from cmacexp.config.component import config_folder
from cmacexp.config.compose import compose_untyped
from cmacexp.config.describe import read_meanings
from cmacexp.errors import CmacexpError

PLACE = re.compile("<!-- fields: begin -->.*<!-- fields: end -->", flags=re.DOTALL)
"""Where they stand in the page."""
SCENARIOS = ("one_leg", "force_step", "quadruped")
"""Whose defaults are shown; the first is that of the command line."""
MODEL = Path(__file__).parents[1] / "tests" / "support" / "robot.xml"
"""Stands for models of robots that are not installed."""
ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={MODEL}")
OF_ROBOTS = ("walk", "amble", "trot", "pace", "mujoco_robot_rigid", "drives", "proprioceptive", "unitree")
"""Options that no other machine can have."""
GROUPS = [
    name for name, kind in Config.__annotations__.items() if kind is not str and (config_folder() / name).is_dir()
]
NEEDS = {"unitree": ["controller=drives"]}
"""What an option needs beside a robot."""
VARIES = "depends on NAME"


@cache
def composed(*overrides: str) -> tuple[Config, dict[str, str]]:
    """The config of these overrides, and the option that each group has in it."""
    config, choices = compose_untyped(overrides)
    return to_config(config), choices


class Row(NamedTuple):
    """A field, and its value in a config."""

    key: str
    field: "Field[Any]"
    schema: type
    value: object


def children(node: Any) -> dict[str, Any]:
    """Nodes inside a node, by their names."""
    return {each.name: getattr(node, each.name) for each in fields(node) if is_dataclass(getattr(node, each.name))}


def are_alike(nodes: Mapping[str, Any]) -> bool:
    """Whether there are several nodes with a class in common, as the signals of the sensors have."""
    return len(nodes) > 1 and len(set.intersection(*(set(type(node).__mro__) for node in nodes.values()))) > 1


def rows_of(node: Any, prefix: str) -> Iterator[Row]:
    """Every field of a node; of nodes inside it that are alike the first, as NAME, stands for all."""
    inner = children(node)
    (first, *others), together = list(inner) or [""], are_alike(inner)
    for field in fields(node):
        key = f"{prefix}{field.name}"
        if field.name not in inner:
            if field.name != "_target_":
                yield Row(key, field, type(node), getattr(node, field.name))
        elif not together:
            yield from rows_of(inner[field.name], f"{key}.")
        elif field.name == first:
            rest = [{row.key: row.value for row in rows_of(inner[name], f"{prefix}NAME.")} for name in others]
            for row in rows_of(inner[first], f"{prefix}NAME."):
                varies = any(each.get(row.key, row.value) != row.value for each in rest)
                yield row._replace(value=VARIES) if varies else row


def shown(value: object) -> str:
    """A value as it is typed."""
    if value == VARIES:
        return VARIES
    return f"`{format_typed(value)}`"


def table_of(nodes: Mapping[str, Any], prefix: str, without: Sequence[str] = ()) -> str:
    """Fields of nodes of one class, but not those in ``without``; where nodes differ, each value by its name."""
    rows = {name: {row.key: row for row in rows_of(node, prefix)} for name, node in nodes.items()}
    first, *others = nodes
    text = "| field | unit | allowed | default | meaning |\n|---|---|---|---|---|\n"
    for key, row in rows[first].items():
        if key.partition(".")[0] in without:
            continue
        values = {name: rows[name].get(key, row).value for name in others}
        other = [f"{name}: {shown(value)}" for name, value in values.items() if value != row.value]
        about = (
            row.field.metadata.get("unit", ""),
            describe_allowed(row.field),
            "; ".join([shown(row.value), *other]),
        )
        text += f"| `{key}` | {' | '.join(about)} | {read_meanings(row.schema).get(row.field.name, '')} |\n"
    inner = [nodes[first], *children(nodes[first]).values()] if prefix else []
    named = [children(each) for each in inner if are_alike(children(each))]
    return "".join(f"`NAME` is one of {', '.join(map(shown, each))}.\n\n" for each in named) + text


def with_option(group: str, option: str) -> Any:
    """The node of a group with one of its options, in the first scenario that can have it.

    Raises:
        CmacexpError: none can.
    """
    if group != "machine" and option in OF_ROBOTS:
        return getattr(composed(*ROBOT, f"{group}={option}", *NEEDS.get(option, ()))[0], group)
    for scenario in SCENARIOS:
        try:
            return getattr(composed(f"scenario={scenario}", f"{group}={option}")[0], group)
        except CmacexpError as error:
            failed = error
    if group == "machine":
        return describe_robot(option)
    raise failed


def describe_robot(option: str) -> Any:
    """The node of a robot, whose model need not be installed; what follows from the model is shown as its rule."""
    node = composed("scenario=robot", f"machine={option}", f"machine.path={MODEL}")[0].machine
    return replace(node, path=None, hip_height="${rule:hip_height}")


def section_of(group: str) -> str:
    """Options of a group, and a table for each class of its fields."""
    paths = sorted(
        (config_folder() / group).glob("*.yaml"), key=lambda path: ("\ndefaults:" in path.read_text(), path)
    )
    nodes: dict[type, dict[str, Any]] = {}
    chosen = set()
    for scenario in SCENARIOS:
        config, choices = composed(f"scenario={scenario}")
        nodes.setdefault(type(getattr(config, group)), {})[scenario] = getattr(config, group)
        chosen.add(choices[group])
    for option in (path.stem for path in paths if path.stem not in chosen):  # first those that build on no other
        node = with_option(group, option)
        nodes.setdefault(type(node), {})[f"`{group}={option}`"] = node
    text = f"## `{group}`\n\n| option | |\n|---|---|\n"
    text += "".join(f"| `{path.stem}` | {describe_option(path)} |\n" for path in paths)
    for schema, same in nodes.items():
        if [each.name for each in fields(schema)] != ["_target_"]:
            head = f"{', '.join(same)}: " if len(nodes) > 1 else ""
            text += f"\n{head}{' '.join((inspect.getdoc(schema) or '').split())}\n\n{table_of(same, f'{group}.')}"
    return text


def all_tables() -> str:
    """Fields of the run, then a section for each group."""
    configs = {scenario: composed(f"scenario={scenario}")[0] for scenario in SCENARIOS}
    return "\n".join(["## Without a group\n", table_of(configs, "", without=GROUPS), *map(section_of, GROUPS)])


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill the page; mkdocs calls this for every page."""
    return PLACE.sub(lambda _: all_tables(), markdown)
