"""Tables of the page config.md: every config field as declared in its class, with the defaults of conf/."""

import inspect
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

SCENARIOS = ("one_leg", "force_step", "quadruped")
"""Scenarios whose defaults are shown; the first is the default of the command line."""
MODEL = Path(__file__).parents[1] / "tests" / "support" / "robot.xml"
"""Model used in place of robot models that are not installed."""
ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={MODEL}")
NEEDS = {name: ["controller=drives"] for name in ("unitree", "unitree_mujoco")}
"""Overrides that an option needs in addition to a robot."""
OF_ROBOTS = (
    "walk",
    "amble",
    "trot",
    "pace",
    "mujoco_robot",
    "mujoco_robot_rigid",
    "drives",
    "proprioceptive",
    *NEEDS,
)
"""Options that only robots can have."""
GROUPS = [
    name for name, kind in Config.__annotations__.items() if kind is not str and (config_folder() / name).is_dir()
]
VARIES = "depends on NAME"


@cache
def composed(*overrides: str) -> tuple[Config, dict[str, str]]:
    """Compose the config of these overrides; return it, and the chosen option of each group."""
    config, choices = compose_untyped(overrides)
    return to_config(config), choices


class Row(NamedTuple):
    """A config field and its value."""

    key: str
    field: "Field[Any]"
    schema: type
    value: object


def children(node: Any) -> dict[str, Any]:
    """Return the config nodes inside a node, by name."""
    return {
        field.name: getattr(node, field.name) for field in fields(node) if is_dataclass(getattr(node, field.name))
    }


def are_alike(nodes: Mapping[str, Any]) -> bool:
    """Check if there are several nodes with a common base class, such as the signals of the sensors."""
    return len(nodes) > 1 and len(set.intersection(*(set(type(node).__mro__) for node in nodes.values()))) > 1


def rows_of(node: Any, prefix: str) -> Iterator[Row]:
    """Yield every field of a node and of the nodes inside it.

    If the inner nodes are alike, the first one represents all of them under the key NAME.
    """
    inner = children(node)
    first, *siblings = list(inner) or [""]
    together = are_alike(inner)
    for field in fields(node):
        key = f"{prefix}{field.name}"
        if field.name not in inner:
            if field.name != "_target_":
                yield Row(key, field, type(node), getattr(node, field.name))
        elif not together:
            yield from rows_of(inner[field.name], f"{key}.")
        elif field.name == first:
            rest = [{row.key: row.value for row in rows_of(inner[name], f"{prefix}NAME.")} for name in siblings]
            for row in rows_of(inner[first], f"{prefix}NAME."):
                varies = any(values.get(row.key, row.value) != row.value for values in rest)
                yield row._replace(value=VARIES) if varies else row


def format_value(value: object) -> str:
    """Format a value as typed on the command line."""
    if value == VARIES:
        return VARIES
    return f"`{format_typed(value)}`"


def table_of(nodes: Mapping[str, Any], prefix: str, without: Sequence[str] = ()) -> str:
    """Format the fields of nodes of one class as a table, except those in ``without``.

    Where the nodes have different values, the cell lists each value with the name of its node.
    """
    rows = {name: {row.key: row for row in rows_of(node, prefix)} for name, node in nodes.items()}
    first, *further = nodes
    text = "| field | unit | allowed | default | meaning |\n|---|---|---|---|---|\n"
    for key, row in rows[first].items():
        if key.partition(".")[0] in without:
            continue
        values = {name: rows[name].get(key, row).value for name in further}
        other = [f"{name}: {format_value(value)}" for name, value in values.items() if value != row.value]
        about = (
            row.field.metadata.get("unit", ""),
            describe_allowed(row.field),
            "; ".join([format_value(row.value), *other]),
        )
        text += f"| `{key}` | {' | '.join(about)} | {read_meanings(row.schema).get(row.field.name, '')} |\n"
    inner = [nodes[first], *children(nodes[first]).values()] if prefix else []
    named = [children(child) for child in inner if are_alike(children(child))]
    return "".join(f"`NAME` is one of {', '.join(map(format_value, names))}.\n\n" for names in named) + text


def with_option(group: str, option: str) -> Any:
    """Return the config node of a group with one of its options, in the first scenario that allows it.

    Raises:
        CmacexpError: no scenario allows it.
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
    """Return the config node of a robot, whose model need not be installed; derived values appear as their rule."""
    config, _ = composed("scenario=robot", f"machine={option}", f"machine.path={MODEL}")
    return replace(config.machine, path=None, hip_height="${rule:hip_height}")


def section_of(group: str) -> str:
    """Format the section of a group: its options, and a table of fields for each class of its nodes."""
    paths = sorted(
        (config_folder() / group).glob("*.yaml"), key=lambda path: ("\ndefaults:" in path.read_text(), path)
    )
    nodes: dict[type, dict[str, Any]] = {}
    chosen = set()
    for scenario in SCENARIOS:
        config, choices = composed(f"scenario={scenario}")
        nodes.setdefault(type(getattr(config, group)), {})[scenario] = getattr(config, group)
        chosen.add(choices[group])
    for option in (
        path.stem for path in paths if path.stem not in chosen
    ):  # sorted: options that extend others come last
        node = with_option(group, option)
        nodes.setdefault(type(node), {})[f"`{group}={option}`"] = node
    text = f"## `{group}`\n\n| option | |\n|---|---|\n"
    text += "".join(f"| `{path.stem}` | {describe_option(path)} |\n" for path in paths)
    for schema, same in nodes.items():
        if [field.name for field in fields(schema)] != ["_target_"]:
            head = f"{', '.join(same)}: " if len(nodes) > 1 else ""
            text += f"\n{head}{' '.join((inspect.getdoc(schema) or '').split())}\n\n{table_of(same, f'{group}.')}"
    return text


def format_fields() -> str:
    """Format the fields without a group, then a section for each group."""
    configs = {scenario: composed(f"scenario={scenario}")[0] for scenario in SCENARIOS}
    return "\n".join(["## Without a group\n", table_of(configs, "", without=GROUPS), *map(section_of, GROUPS)])
