"""From overrides, as typed on the command line, to a checked config; and Hydra's record of it, as texts."""

import pickle
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import is_dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from threading import RLock
from typing import Any

import yaml
from omegaconf import DictConfig, OmegaConf, open_dict

from cmacexp.config.check import check
from cmacexp.config.component import config_folder
from cmacexp.config.fields import read_field
from cmacexp.config.load import GROUPS, to_config
from cmacexp.config.robot_rule import READ, find_mistake
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.jit.interrupt import exits_caught

_MISSING = object()
Node = DictConfig | Mapping[str, Any]
_NUMBER = re.compile(r"([a-z]\w*(?:\.\w+)*)=(-?(?:0|[1-9]\d*)(\.\d+)?(e-?\d+)?)")
"""An override that sets a number: its key, the number, its fraction and its exponent, with which it is a float."""


@lru_cache(4096)
def parse_override(override: str) -> Any:
    """What Hydra reads in an override."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create().parse_overrides([override])[0]


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


def expand_grid(overrides: Sequence[Any], most: int | None) -> list[list[list[str]]]:
    """The overrides of the jobs of a grid, in batches of ``most`` jobs; None: in one.

    Raises BadInput for a sweep that is no list of values.
    """
    values: dict[str, list[str]] = {}
    for override in overrides:
        key = override.get_key_element()
        if not override.is_sweep_override():
            values[key] = [override.get_value_element_as_str()]
        elif override.is_discrete_sweep():
            values[key] = list(override.sweep_string_iterator())
        else:
            typed = str(override.input_line).partition("=")[2]
            raise BadInput(
                key, typed, "must list values: 8,16 or range(8,16); a sweeper that searches takes intervals"
            )
    jobs = [[f"{key}={value}" for key, value in zip(values, row, strict=True)] for row in product(*values.values())]
    most = most or len(jobs)
    return [jobs[first : first + most] for first in range(0, len(jobs), most)]


def refuse_options(overrides: Iterable[str]) -> None:
    """Raise BadInput for an option of the command line among overrides from Python."""
    for text in overrides:
        is_option = text.startswith(("-", "hydra.", "hydra/"))
        require(not is_option, "overrides", text, "is an option of the command line; give config overrides only")


def set_values(config: DictConfig, overrides: Iterable[str]) -> None:
    """Set values of keys in a composed config, as Hydra does once the options are chosen."""
    for override in map(parse_override, overrides):
        adds = override.is_add() or override.is_force_add()
        OmegaConf.update(config, override.key_or_group, override.value(), merge=True, force_add=adds)


def _compose(overrides: Sequence[str]) -> tuple[DictConfig, dict[str, str]]:
    """What Hydra composes, and the option that it chose in each group."""
    from hydra import compose, initialize_config_dir  # 60 ms, which who loads a sweep need not wait

    with _one_at_a_time, initialize_config_dir(str(config_folder()), version_base="1.3"):
        config = compose("config", list(overrides), return_hydra_config=True)
    choices = dict(config.hydra.runtime.choices)
    with open_dict(config):
        del config["hydra"]
    return config, choices


def _is_group(key: str) -> bool:
    return key in ("scenario", *GROUPS)


def split_overrides(
    overrides: Sequence[str], is_group: Callable[[str], Any] = _is_group
) -> tuple[tuple[str, ...], list[str]]:
    """What Hydra has to compose, and what sets values in that afterwards, each in the order in which it is typed.

    Hydra too chooses the options of groups before it sets values, whatever their order. A dictionary sets values of
    the option that is chosen. Hydra composes all if an override removes a key or names a package.
    """
    options, values = list[str](), list[str]()
    for text in overrides:
        key, _, value = text.partition("=")
        if key.startswith("~") or "@" in key:
            return tuple(overrides), []
        is_option = is_group(key.lstrip("+")) and not value.lstrip().startswith("{")
        (options if is_option else values).append(text)
    return tuple(options), values


@lru_cache(1 << 10)
def _pickle_options(options: tuple[str, ...]) -> bytes:
    """What :func:`_compose` gives for options alone: Hydra takes longer to read some 30 files than most runs take.

    Pickled: nothing copies a config faster.
    """
    return pickle.dumps(_compose(options))


def _compose_cached(overrides: Sequence[str]) -> tuple[DictConfig, dict[str, str]]:
    """The same from a cached result: Hydra, too, chooses options before it sets values, whatever their order."""
    from hydra.core.override_parser.types import OverrideType

    options, values = split_overrides(overrides)
    config, choices = pickle.loads(_pickle_options(options))
    for text in values:
        override = parse_override(text)
        known = OmegaConf.select(config, override.key_or_group, default=_MISSING, throw_on_resolution_failure=False)
        kinds = (OverrideType.ADD if known is _MISSING else OverrideType.CHANGE, OverrideType.FORCE_ADD)
        if override.type not in kinds or override.is_sweep_override():
            return _compose(overrides)  # which says what is wrong
        set_values(config, [text])
    return config, choices


def compose_config(overrides: Sequence[str], config_dir: str | Path | None = None, is_shared: bool = False) -> Config:
    """The checked config of a command line, e.g. ``["scenario=one_leg", "cycles=3"]``.

    ``config_dir`` is a folder of custom configs, as ``--config-dir``; its files are read anew by each call. Nothing
    may change one that ``is_shared``: it is in part that of other overrides. Raises CmacexpError with the message of
    the command line.
    """
    options, values = split_overrides(overrides)
    others = max((place for place, text in enumerate(values, 1) if not _NUMBER.fullmatch(text)), default=0)
    known = _compose_first((*options, *values[:others])) if config_dir is None else None
    if known is None or (config := set_numbers(known[0], values[others:], known[1])) is None:
        return to_config(compose_untyped(overrides, config_dir)[0])
    if not isinstance(config, Config):
        return to_config(config)
    return config if is_shared else pickle.loads(pickle.dumps(config))  # type: ignore[no-any-return]


@exits_caught()  # of the check of a component
def set_numbers(known: Any, overrides: Iterable[str], referred: frozenset[str] = frozenset()) -> Any:
    """A config, plain or not, with numbers set, such as ``learning.rate=0.5``, as in most runs.

    That takes a twentieth of the time of Hydra's grammar and of OmegaConf. Of a config that is not pickled the groups
    that remain are shared. ``referred`` are groups, and keys without one, from which other values follow, so that no
    number in them can be set alone. None if an override does something else, or the config is not plain and wrong
    with these numbers: the longer way says which is the first mistake.
    """
    config = pickle.loads(known) if isinstance(known, bytes) else copy(known)
    with suppress(BadInput):
        for text in overrides:
            if (found := _NUMBER.fullmatch(text)) is None:
                return None
            *path, name = found[1].split(".")
            owner = config
            for key in path:
                values = _list_values(owner)
                values[key] = owner = copy(values.get(key))
            value = float(found[2]) if found[3] or found[4] else int(found[2])
            values = _list_values(owner)
            if (
                isinstance(values.get(name, {}), dict | list)
                or is_dataclass(values[name])
                or (*path, name)[0] in referred
            ):
                return None
            values[name] = value if owner is values else read_field(type(owner), name, value, found[1])
        if isinstance(config, Config):
            check(config)
        return config
    return None


def _list_values(node: Any) -> dict[str, Any]:
    """What a group of fields has, by name; of a value nothing."""
    return node if isinstance(node, dict) else vars(node) if is_dataclass(node) else {}


@lru_cache(64)
def _compose_first(overrides: tuple[str, ...]) -> tuple[Config | bytes, frozenset[str]] | None:
    """The config that overrides give without the numbers after them, as :func:`set_numbers` takes it.

    It is plain if they name a class, which a user may define again. With it :func:`find_referred`. None if they or
    their options give no config, or that is None.
    """
    options, _ = split_overrides(overrides)
    if options != overrides and _compose_first(options) is None:
        return None
    try:
        config = _compose_cached(overrides)[0]
        known: Config | bytes = to_config(config)
        if any("_target_" in text for text in overrides):
            known = pickle.dumps(OmegaConf.to_container(config, resolve=True, enum_to_str=True))
    except Exception:  # of whatever kind: the longer way raises it again, and says what is wrong
        return None
    return None if (referred := find_referred(config)) is None else (known, referred)


def find_referred(config: DictConfig) -> frozenset[str] | None:
    """Keys of a config from which other values follow, for :func:`set_numbers`; None if they are not known."""
    references = re.findall(r"\$\{([^}]*)", str(OmegaConf.to_container(config)))
    if not all(re.fullmatch(r"rule:\w+|[a-z]\w*\.[\w.]+", name) for name in references):
        return None
    return frozenset().union(*(READ if name[:5] == "rule:" else {name.partition(".")[0]} for name in references))


def compose_untyped(
    overrides: Sequence[str], config_dir: str | Path | None = None
) -> tuple[DictConfig, dict[str, str]]:
    """What :func:`cmacexp.config.to_config` takes, and the option of each group, e.g. ``{"feedforward": "cmac"}``.

    Raises CmacexpError if Hydra cannot compose it.
    """
    from cmacexp.config.explain import explain_composition

    require(config_dir is None or Path(config_dir).is_dir(), "config_dir", config_dir, "is no folder")
    try:
        if config_dir is None:
            return _compose_cached(overrides)
        return _compose([*overrides, f"hydra.searchpath=[file://{Path(config_dir).resolve()}]"])
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


def make_record(composed: Node, hydra: Node) -> dict[str, str]:
    """The files, by name, that Hydra writes unless ``hydra.output_subdir`` is null."""
    plain: Iterator[Any] = (
        OmegaConf.to_container(node, enum_to_str=True) if isinstance(node, DictConfig) else node
        for node in (composed, hydra)
    )
    config, own = plain
    parts = [_dump(pickle.dumps({"hydra": {key: value}})) for key, value in own.items()]
    return {
        "config.yaml": "".join(_dump(pickle.dumps({key: value})) for key, value in config.items()),
        "hydra.yaml": "hydra:\n" + "".join(text.removeprefix("hydra:\n") for text in parts),
        "overrides.yaml": _dump(pickle.dumps(own["overrides"]["task"])),
    }
