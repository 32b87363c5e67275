"""Conversion of a composed config to a typed and checked :class:`Config`, and its hash."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config.check import check
from cmacexp.config.component import (
    COMPONENTS,
    config_class,
    config_folder,
    current_folder_importable,
    find_class,
    find_new_name,
    find_option,
    select_accepted_fields,
)
from cmacexp.config.fields import read_fields
from cmacexp.config.machine import MACHINES
from cmacexp.config.robot_rule import find_mistake, rule_value
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput, require
from cmacexp.jit.interrupt import exits_caught

WITHOUT_EFFECT = ("record", "sweep", "optimize", "warn", "hydra")
"""Root keys that do not affect the results of a run, and are not part of its hash."""
STATED = ("measured_with", "fingerprint")
"""Keys of a machine that record the model of published results; not part of the hash either."""

OmegaConf.register_new_resolver("rule", rule_value, replace=True)


def _make_component(group: str, node: Mapping[str, Any]) -> Any:
    """Make the config of a component: an object of its config class, or its fields if it has none."""
    target = node.get("_target_")
    if isinstance(target, str):
        node = {**node, "_target_": (target := find_new_name(target))}
    component = find_class(f"{group}._target_", target)
    accepted = select_accepted_fields(group, node, component)
    schema = config_class(component)
    return accepted if schema is None else read_fields(schema, accepted, group)


def _make_machine(node: Mapping[str, Any], target: object) -> Any:
    """Make the config of a machine.

    ``target`` is the class of the plant: an unknown key may come from the settings of a plant for another machine,
    which the message then says. Raises BadInput.
    """
    kind = node.get("kind")
    if not isinstance(kind, str) or kind not in MACHINES:
        raise BadInput("machine.kind", kind, "choose from " + ", ".join(MACHINES))
    names = {other: {field.name for field in fields(schema)} for other, schema in MACHINES.items()}
    unknown = [name for name in node if name not in names[kind]]
    plant = find_option("plant", str(target))
    path = config_folder() / "for_plant" / f"{plant}.yaml"
    settings: Any = OmegaConf.load(path) if unknown and path.exists() else {}
    if unknown and unknown[0] in settings.get("machine", {}):
        fitting = " or ".join(other for other in MACHINES if unknown[0] in names[other])
        raise BadInput(
            "plant", plant, f"is not for machine.kind={kind}: choose a scenario with machine.kind={fitting}"
        )
    return read_fields(MACHINES[kind], node, "machine")


GROUPS = tuple(field.name for field in fields(Config)[1:] if (config_folder() / field.name).is_dir())
"""Groups of fields that have options, except ``scenario``."""


@exits_caught()  # the config class of a component, or its check, may call exit
def to_config(composed: DictConfig | Mapping[str, Any]) -> Config:
    """Convert a config that Hydra composed, or plain values as in a manifest, to a typed and checked one.

    Raises BadInput for the first value that has a wrong type or is out of range, or combination that is invalid.
    """
    plain: Any = composed
    try:
        if isinstance(composed, DictConfig):
            plain = OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        reason = str(error.msg or error).splitlines()[0]
        raise find_mistake(error) or BadInput(
            str(error.full_key or "config"), "?", reason[:1].lower() + reason[1:]
        ) from error
    require(
        not isinstance(plain.get("scenario"), dict),
        "scenario",
        plain.get("scenario"),
        "is a group of fields: the file of a scenario begins with the line '# @package _global_'",
    )
    for group in GROUPS:
        require(
            isinstance(plain.get(group), dict),
            group,
            plain.get(group),
            f"must be a group of fields; choose an option of conf/{group}",
        )
    with current_folder_importable():
        components = {group: _make_component(group, plain[group]) for group in COMPONENTS}
    machine = _make_machine(plain["machine"], plain["plant"].get("_target_"))
    config = read_fields(Config, {**plain, **components, "machine": machine})
    check(config)
    return config


def to_plain(config: Any) -> Any:
    """Convert a config to plain dictionaries and lists, as in a manifest."""
    if is_dataclass(config):
        return {name: to_plain(value) for name, value in vars(config).items()}
    if isinstance(config, list):
        return [to_plain(item) for item in config]
    return {name: to_plain(value) for name, value in config.items()} if isinstance(config, dict) else config


def select_effective(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Select the subset of a plain config that affects the results of a run."""
    effective = {key: value for key, value in plain.items() if key not in WITHOUT_EFFECT}
    if isinstance(machine := effective.get("machine"), Mapping):
        effective["machine"] = {key: value for key, value in machine.items() if key not in STATED}
    return effective


def config_hash(plain: Mapping[str, Any]) -> str:
    """Compute the SHA-256 of the subset of a plain config that affects the results of a run."""
    return hashlib.sha256(json.dumps(select_effective(plain), sort_keys=True).encode()).hexdigest()
