"""From what Hydra composed to a typed and checked :class:`Config`, and its hash."""

import hashlib
import json
import re
import sys
from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigKeyError, OmegaConfBaseException

from cmacexp.config.check import check
from cmacexp.config.component import COMPONENTS, ComponentConfig, config_class, fit_fields
from cmacexp.config.fields import TYPES, listed
from cmacexp.config.folder import config_folder
from cmacexp.config.machine import MACHINES
from cmacexp.config.robot_rule import find_mistake, register_rule
from cmacexp.config.schema import Config
from cmacexp.config.targets import NEW_NAMES, current_folder_importable, find_class, say_new_name
from cmacexp.errors import BadInput

WITHOUT_EFFECT = ("record", "sweep", "optimize", "warn", "hydra")
"""Root keys that do not change the results of a run, and so stay out of its hash."""
WITHOUT_OPTIONS = ("scenario", "cycles", "seed", "sampling_period", "reference", "sweep", "optimize", "warn")
"""Root keys that are not groups."""

register_rule()

FLAGS = ("true", "false", "yes", "no", "on", "off", "y", "n", "1", "0")
"""What can be typed for a flag."""


def _require_groups(plain: Mapping[str, Any]) -> None:
    for group in (field.name for field in fields(Config) if field.name not in WITHOUT_OPTIONS):
        if not isinstance(plain.get(group), dict):
            raise BadInput(group, plain.get(group), f"must be a group of fields; choose an option of conf/{group}")


def _require_values(node: object, key: str = "") -> None:
    """Require that no number has more digits than a float can hold, on which conversions and checks fail."""
    if isinstance(node, Mapping):
        for name, value in node.items():
            _require_values(value, f"{key}.{name}" if key else str(name))
    elif isinstance(node, list):
        for value in node:
            _require_values(value, key)
    elif isinstance(node, int) and abs(node) > sys.float_info.max:
        raise BadInput(key, node, f"must be below {sys.float_info.max:.0e}")


def _machine_schema(kind: object) -> DictConfig:
    if not isinstance(kind, str) or kind not in MACHINES:
        raise BadInput("machine.kind", kind, "choose from " + ", ".join(MACHINES))
    return OmegaConf.structured(MACHINES[str(kind)])


def _component(
    group: str, node: Mapping[str, Any], choices: Mapping[str, str] | None
) -> tuple[dict[str, Any], type[ComponentConfig] | None]:
    """The fields that a component takes, and the config class that it carries, if any."""
    target = node.get("_target_")
    if isinstance(target, str) and target in NEW_NAMES:
        if choices is not None:
            say_new_name(target)
        node = {**node, "_target_": NEW_NAMES[target]}
    component = find_class(f"{group}._target_", node.get("_target_"))
    return fit_fields(group, node, component, choices), config_class(component)


def _with_schema(composed: DictConfig, choices: Mapping[str, str] | None) -> tuple[DictConfig, dict[str, Any]]:
    """A config with the types of Config, of its machine and of its components; and its values before that."""
    schema, plain = OmegaConf.structured(Config), cast(dict[str, Any], OmegaConf.to_container(composed, resolve=True))
    _require_groups(plain)
    _require_values(plain)
    schema.machine = _machine_schema(plain["machine"].get("kind"))
    fitted: dict[str, Any] = {}
    with current_folder_importable():
        for group in COMPONENTS:
            fitted[group], own = _component(group, plain[group], choices)
            if own is not None:
                schema[group] = OmegaConf.structured(own)
    given: Any = composed if all(fitted[group] == plain[group] for group in COMPONENTS) else plain | fitted
    return cast(DictConfig, OmegaConf.merge(schema, given)), plain | fitted


def to_config(composed: DictConfig, choices: Mapping[str, str] | None = None) -> Config:
    """Type and check a composed config.

    Args:
        composed: what Hydra composed, or the ``config`` of a manifest as a DictConfig.
        choices: the option that Hydra chose in each group; None: not known, as of a manifest.

    Returns:
        The config; every value in its range, every combination of values possible.

    Raises:
        BadInput: names the first key that is wrong.
    """
    try:
        typed, values = _with_schema(composed, choices)
        config = OmegaConf.to_object(typed)
    except OmegaConfBaseException as error:
        raise find_mistake(error) or _explain(error, composed, choices or {}) from error
    assert isinstance(config, Config)
    _require_as_typed(values, config)
    check(config)
    return config


def _require_as_typed(given: Mapping[str, Any], config: Any, before: str = "") -> None:
    """Require that OmegaConf has turned no number into a flag, and no number or flag into text.

    Raises:
        BadInput: names the first field whose value would not be what was typed.
    """
    for each in fields(config):
        typed, value = given.get(each.name), getattr(config, each.name)
        key = f"{before}{each.name}"
        if is_dataclass(value):
            _require_as_typed(typed or {}, value, f"{key}.")
        elif isinstance(value, bool) and str(typed).lower() not in FLAGS:
            raise BadInput(key, typed, f"must be {TYPES[bool]}")
        elif isinstance(value, str) and typed is not None and not isinstance(typed, str):
            raise BadInput(key, typed, f"must be {TYPES[str]}; if it looks like a number, put it into quotes")


KINDS = {"Integer": TYPES[int], "Float": TYPES[float], "Boolean": TYPES[bool]}
"""OmegaConf's names of types in words."""


def _set_by_plant(key: str, kind: object, choices: Mapping[str, str]) -> BadInput | None:
    """The mistake, if a key that the machine does not have was set by the plant, and not by the user."""
    plant = choices.get("plant", "")
    file, (parent, _, name) = config_folder() / "for_plant" / f"{plant}.yaml", key.rpartition(".")
    node = OmegaConf.select(OmegaConf.load(file), parent) if file.exists() else None
    if parent != "machine" or name not in (node or {}):
        return None
    fitting = [each for each, schema in MACHINES.items() if name in (field.name for field in fields(schema))]
    wanted = " or ".join(fitting)
    return BadInput("plant", plant, f"is not for machine.kind={kind}: choose a scenario with machine.kind={wanted}")


def _explain(error: OmegaConfBaseException, composed: DictConfig, choices: Mapping[str, str]) -> BadInput:
    """Say in one line what OmegaConf says in five."""
    key = str(error.full_key or error.key or "config")
    text = str(error.msg or error or type(error).__name__)
    typed = re.match(r"Value .* could not be converted to (\w+)", text, re.DOTALL)
    reason = f"must be {KINDS.get(typed[1], typed[1])}" if typed else text.splitlines()[0]
    if isinstance(error, ConfigKeyError):
        parent, _, unknown = key.rpartition(".")
        node = OmegaConf.select(composed, parent) if parent else composed
        if (mistake := _set_by_plant(key, OmegaConf.select(composed, "machine.kind"), choices)) is not None:
            return mistake
        names = [str(name) for name in node if name != unknown]
        reason = f"no such key; {parent or 'the config'} has {listed(names)}"
    try:
        value = OmegaConf.select(composed, key, throw_on_missing=False)
    except OmegaConfBaseException:
        value = "?"
    return BadInput(key, value, reason[:1].lower() + reason[1:])


def to_plain(config: Config) -> dict[str, Any]:
    """The config as plain dictionaries and lists, as it stands in the manifest."""
    return asdict(config)


def config_hash(plain: dict[str, Any]) -> str:
    """SHA-256 of all that changes the results of a run.

    Args:
        plain: a config as :func:`to_plain` gives it.
    """
    kept = {key: value for key, value in plain.items() if key not in WITHOUT_EFFECT}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()
