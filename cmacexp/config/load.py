"""From what Hydra composed to a typed and checked :class:`Config`, and its hash."""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigKeyError, OmegaConfBaseException

from cmacexp.config.check import check
from cmacexp.config.component import COMPONENTS, ComponentConfig, config_class, fit_fields
from cmacexp.config.fields import listed
from cmacexp.config.folder import config_folder
from cmacexp.config.machine import MACHINES
from cmacexp.config.schema import Config
from cmacexp.config.targets import NEW_NAMES, current_folder_importable, find_class, say_new_name
from cmacexp.errors import BadInput

WITHOUT_EFFECT = ("record", "sweep", "optimize", "warn", "hydra")
"""Root keys that do not change the results of a run, and so stay out of its hash."""
WITHOUT_OPTIONS = ("scenario", "cycles", "seed", "sampling_period", "reference", "sweep", "optimize", "warn")
"""Root keys that are not groups."""


def _require_groups(plain: Mapping[str, Any]) -> None:
    for group in (field.name for field in fields(Config) if field.name not in WITHOUT_OPTIONS):
        if not isinstance(plain.get(group), dict):
            raise BadInput(group, plain.get(group), f"must be a group of fields; choose an option of conf/{group}")


def _machine_schema(kind: object) -> DictConfig:
    if kind not in MACHINES:
        raise BadInput("machine.kind", kind, "choose from " + ", ".join(MACHINES))
    return OmegaConf.structured(MACHINES[str(kind)])


def _component(
    group: str, node: Mapping[str, Any], choices: Mapping[str, str] | None
) -> tuple[dict[str, Any], type[ComponentConfig] | None]:
    """The fields that a component takes, and the config class that it carries, if any."""
    target = node.get("_target_")
    if target in NEW_NAMES:
        if choices is not None:
            say_new_name(str(target))
        node = {**node, "_target_": NEW_NAMES[str(target)]}
    component = find_class(f"{group}._target_", node.get("_target_"))
    return fit_fields(group, node, component, choices), config_class(component)


def _with_schema(composed: DictConfig, choices: Mapping[str, str] | None) -> DictConfig:
    """A config with the types of Config, of its machine and of its components."""
    schema, plain = OmegaConf.structured(Config), cast(dict[str, Any], OmegaConf.to_container(composed, resolve=True))
    _require_groups(plain)
    schema.machine = _machine_schema(plain["machine"].get("kind"))
    fitted: dict[str, Any] = {}
    with current_folder_importable():
        for group in COMPONENTS:
            fitted[group], own = _component(group, plain[group], choices)
            if own is not None:
                schema[group] = OmegaConf.structured(own)
    given: Any = composed if all(fitted[group] == plain[group] for group in COMPONENTS) else plain | fitted
    return cast(DictConfig, OmegaConf.merge(schema, given))


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
        config = OmegaConf.to_object(_with_schema(composed, choices))
    except OmegaConfBaseException as error:
        raise _explain(error, composed, choices or {}) from error
    assert isinstance(config, Config)
    check(config)
    return config


KINDS = {"Integer": "a whole number", "Float": "a number", "Boolean": "true or false"}
"""OmegaConf's names of types in words."""


def _name_setter(key: str, choices: Mapping[str, str]) -> str:
    """Which plant sets a key that the machine does not have; empty if none does."""
    plant = choices.get("plant", "")
    file, (parent, _, name) = config_folder() / "for_plant" / f"{plant}.yaml", key.rpartition(".")
    node = OmegaConf.select(OmegaConf.load(file), parent) if file.exists() else None
    return f"; plant={plant} sets it: choose a scenario with another machine" if name in (node or {}) else ""


def _explain(error: OmegaConfBaseException, composed: DictConfig, choices: Mapping[str, str]) -> BadInput:
    """Say in one line what OmegaConf says in five."""
    key = str(error.full_key or error.key or "config")
    reason = str(error.msg or error or type(error).__name__).splitlines()[0]
    if typed := re.fullmatch(r"Value .* could not be converted to (\w+)", reason):
        reason = f"must be {KINDS.get(typed[1], typed[1])}"
    if isinstance(error, ConfigKeyError):
        parent, _, unknown = key.rpartition(".")
        node = OmegaConf.select(composed, parent) if parent else composed
        names = [str(name) for name in node if name != unknown]
        reason = f"no such key; {parent or 'the config'} has {listed(names)}{_name_setter(key, choices)}"
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
