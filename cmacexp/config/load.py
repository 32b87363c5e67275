"""From what Hydra composed to a typed and checked :class:`Config`, and its hash."""

import hashlib
import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigKeyError, OmegaConfBaseException

from cmacexp.config.check import check
from cmacexp.config.fields import listed
from cmacexp.config.machine import MACHINES
from cmacexp.config.schema import BUILT_IN_PARTS, Config
from cmacexp.errors import BadInput

WITHOUT_EFFECT = ("record", "sweep", "optimize", "warn", "hydra")
"""Root keys that do not change the results of a run, and so stay out of its hash."""


WITHOUT_OPTIONS = ("scenario", "cycles", "seed", "sampling_period", "reference", "sweep", "optimize", "warn")
"""Root keys that are not groups."""


def config_folder() -> Path:
    """The folder of the shipped configs: inside an installed package, else at the top of the checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def _schema(composed: DictConfig) -> DictConfig:
    """The schema of Config with the parts that this config chose filled in."""
    schema = OmegaConf.structured(Config)
    for group in (field.name for field in fields(Config) if field.name not in WITHOUT_OPTIONS):
        if not isinstance(composed.get(group), DictConfig):
            raise BadInput(group, composed.get(group), f"must be a group of fields; choose an option of conf/{group}")
    kind = composed.machine.get("kind")
    if kind not in MACHINES:
        raise BadInput("machine.kind", kind, "choose from " + ", ".join(MACHINES))
    schema.machine = OmegaConf.structured(MACHINES[kind])
    for part in ("plant", "sensors", "controller", "feedforward"):
        target = composed[part].get("_target_")
        if target in BUILT_IN_PARTS:
            schema[part] = OmegaConf.structured(BUILT_IN_PARTS[target])
    assert isinstance(schema, DictConfig)
    return schema


def to_config(composed: DictConfig) -> Config:
    """Type and check a composed config.

    Args:
        composed: what Hydra composed, or the ``config`` of a manifest as a DictConfig.

    Returns:
        The config; every value in its range, every combination of values possible.

    Raises:
        BadInput: names the first key that cannot stay as it is.
    """
    try:
        merged = OmegaConf.merge(_schema(composed), composed)
        config = OmegaConf.to_object(merged)
    except OmegaConfBaseException as error:
        raise _explain(error, composed) from error
    assert isinstance(config, Config)
    check(config)
    return config


def _explain(error: OmegaConfBaseException, composed: DictConfig) -> BadInput:
    """Say in one line what OmegaConf says in five."""
    key = str(error.full_key or error.key or "config")
    reason = str(error.msg or error or type(error).__name__).splitlines()[0]
    if isinstance(error, ConfigKeyError):
        parent, _, unknown = key.rpartition(".")
        node = OmegaConf.select(composed, parent) if parent else composed
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
