"""From overrides, as typed on the command line, to a checked config; and Hydra's record of it, as texts."""

import pickle
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from threading import RLock
from typing import Any

import yaml
from omegaconf import DictConfig, open_dict

from cmacexp.config.component import config_folder
from cmacexp.config.load import list_groups, to_config
from cmacexp.config.robot_rule import find_mistake
from cmacexp.config.schema import Config
from cmacexp.config.template import ConfigTemplate, NeedsHydra
from cmacexp.errors import CmacexpError, require

_one_at_a_time = RLock()
"""Hydra keeps where it looks for configs in a variable of the process."""


def list_texts(overrides: Iterable[str]) -> list[str]:
    """Overrides from Python as a list: they may come one by one. Raises BadInput unless each is a text."""
    is_list = isinstance(overrides, Iterable) and not isinstance(overrides, str)
    require(is_list, "overrides", overrides, 'must be a list of texts, such as ["cycles=3"]')
    texts = list(overrides)
    for text in texts:
        require(isinstance(text, str), "overrides", text, 'must be a text, such as "cycles=3"')
    return texts


def refuse_options(overrides: Iterable[str]) -> None:
    """Raise BadInput for an option of the command line among overrides from Python."""
    for text in overrides:
        is_option = text.lstrip("+~").startswith(("-", "hydra.", "hydra/"))
        require(not is_option, "overrides", text, "is an option of the command line; give config overrides only")


def _compose(overrides: Sequence[str]) -> tuple[DictConfig, dict[str, str]]:
    """What Hydra composes, and the option that it chose in each group."""
    from hydra import compose, initialize_config_dir  # 60 ms, which who loads a sweep need not wait

    with _one_at_a_time, initialize_config_dir(str(config_folder()), version_base="1.3"):
        config = compose("config", list(overrides), return_hydra_config=True)
    choices = dict(config.hydra.runtime.choices)
    with open_dict(config):
        del config["hydra"]
    return config, choices


def _is_option(override: str) -> bool:
    """Whether an override chooses the option of a group."""
    return override.partition("=")[0] in ("scenario", *list_groups())


@cache
def _compose_options(options: tuple[str, ...]) -> tuple[ConfigTemplate, dict[str, str]]:
    """What :func:`_compose` gives for options alone: Hydra takes longer to read some 30 files than most runs take."""
    composed, choices = _compose(options)
    return ConfigTemplate(composed), choices


def compose_config(overrides: Sequence[str], config_dir: str | Path | None = None) -> Config:
    """The checked config of a command line, e.g. ``["scenario=one_leg", "cycles=3"]``.

    ``config_dir`` is a folder of custom configs, as ``--config-dir``; its files are read anew by each call. Raises
    CmacexpError with the message of the command line.
    """
    return to_config(compose_untyped(overrides, config_dir)[0])


def compose_untyped(
    overrides: Sequence[str], config_dir: str | Path | None = None
) -> tuple[DictConfig | dict[str, Any], dict[str, str]]:
    """What :func:`cmacexp.config.to_config` takes, and the option of each group, e.g. ``{"feedforward": "cmac"}``.

    Raises CmacexpError if Hydra cannot compose it.
    """
    from cmacexp.config.explain import explain_composition

    require(config_dir is None or Path(config_dir).is_dir(), "config_dir", config_dir, "is no folder")
    try:
        if config_dir is not None:
            return _compose([*overrides, f"hydra.searchpath=[file://{Path(config_dir).resolve()}]"])
        with suppress(NeedsHydra):
            # Hydra, too, chooses options before it sets values, whatever their order.
            template, choices = _compose_options(tuple(filter(_is_option, overrides)))
            return template.resolve([text for text in overrides if not _is_option(text)]), dict(choices)
        return _compose(overrides)
    except Exception as error:  # Hydra expects no null among options, for example, and says so by a TypeError
        raise find_mistake(error) or CmacexpError(explain_composition(error, overrides)) from None


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]  # the former is six times as fast
    """Writes what OmegaConf reads, which takes more texts than YAML for numbers."""

    def represent_text(self, text: str) -> yaml.ScalarNode:
        """Text, quoted unless it begins with a letter."""
        return self.represent_scalar("tag:yaml.org,2002:str", text, None if text[:1].isalpha() else "'")


_Dumper.add_representer(str, _Dumper.represent_text)


@lru_cache(1 << 10)
def _dump(packed: bytes) -> str:
    """A pickled value as YAML, which takes as long as the run if all groups are written anew for each job."""
    return yaml.dump(pickle.loads(packed), Dumper=_Dumper, sort_keys=False)  # type: ignore[no-any-return]


def make_record(config: Mapping[str, Any], hydra: Mapping[str, Any]) -> dict[str, str]:
    """The files, by name, that Hydra writes unless ``hydra.output_subdir`` is null, of what it composed as plain.

    ``hydra`` is its own part, which the config is without.
    """
    parts = [_dump(pickle.dumps({"hydra": {key: value}})) for key, value in hydra.items()]
    return {
        "config.yaml": "".join(_dump(pickle.dumps({key: value})) for key, value in config.items()),
        "hydra.yaml": "hydra:\n" + "".join(text.removeprefix("hydra:\n") for text in parts),
        "overrides.yaml": _dump(pickle.dumps(hydra["overrides"]["task"])),
    }
