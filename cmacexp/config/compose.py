"""From overrides, as typed on the command line, to a checked config; for studies and notebooks."""

import copy
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config.folder import config_folder
from cmacexp.config.load import to_config
from cmacexp.config.schema import Config
from cmacexp.errors import CmacexpError

MISSING = object()


@cache
def _parser() -> Any:
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create()


@cache
def _groups() -> set[str]:
    return {folder.name for folder in config_folder().iterdir() if folder.is_dir()}


@cache
def _composed(overrides: tuple[str, ...], config_dir: str | None = None) -> tuple[DictConfig, dict[str, str]]:
    """What Hydra composes, and the option of each group: reading some 30 files takes it longer than most runs."""
    from hydra import compose, initialize_config_dir

    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        places = [f"hydra.searchpath=[file://{config_dir}]"] if config_dir else []
        composed = compose("config", [*overrides, *places], return_hydra_config=True)
    choices = dict(composed.hydra.runtime.choices)
    with open_dict(composed):
        del composed["hydra"]
    return composed, choices


def _values(overrides: Sequence[str]) -> list[tuple[str, Any]] | None:
    """Keys and values of overrides that set plain values of existing keys; None if one does something else."""
    found = []
    for override in _parser().parse_overrides(list(overrides)):
        if override.type is None or override.type.name != "CHANGE" or override.is_sweep_override():
            return None
        found.append((override.key_or_group, override.value()))
    return found


def _quick(overrides: Sequence[str]) -> tuple[DictConfig, dict[str, str]] | None:
    """The same config as Hydra composes of ``overrides``, from one that it has composed before; None if it cannot be.

    Groups are chosen first and values set then, in Hydra as well, whatever their order.
    """
    choices = tuple(text for text in overrides if text.partition("=")[0] in _groups())
    values = _values([text for text in overrides if text not in choices])
    if values is None:
        return None
    composed, options = _composed(choices)
    config = copy.deepcopy(composed)
    for key, value in values:
        if OmegaConf.select(config, key, default=MISSING) is MISSING:
            return None
        OmegaConf.update(config, key, value, merge=True)
    return config, options


def compose_config(overrides: Sequence[str], config_dir: str | Path | None = None) -> Config:
    """The checked config of a command line.

    Args:
        overrides: as on the command line, e.g. ``["scenario=one_leg", "cycles=3"]``.
        config_dir: a folder of one's own configs, as ``--config-dir``.

    Raises:
        CmacexpError: a name or a value that cannot be; the message is that of the command line.
    """
    from hydra.errors import HydraException

    from cmacexp.config.explain import explain_composition

    try:
        own = None if config_dir is None else str(Path(config_dir).resolve())
        if own is not None:  # its files may have changed since
            return to_config(*_composed.__wrapped__(tuple(overrides), own))
        return to_config(*(_quick(overrides) or _composed.__wrapped__(tuple(overrides))))
    except (HydraException, OmegaConfBaseException) as error:
        raise CmacexpError(explain_composition(error, list(overrides))) from error
