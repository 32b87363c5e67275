"""Composition of a checked config from overrides, as on the command line, and Hydra's record of it."""

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
"""Default for keys that a config lacks."""
Node = DictConfig | Mapping[str, Any]
_VALUE = r"(?:True|False|-?(?:0|[1-9]\d*)(?:\.\d+)?(?:e-?\d+)?|(?!(?:nan|inf|infinity)\b)[a-z][a-z_]*\d*)"
_PLAIN = re.compile(rf"([a-z]\w*(?:\.\w+)*)=({_VALUE}|\[{_VALUE}(?:, ?{_VALUE})*\])")
"""An override that sets a number, a word in lower case, or a list of these: key and value."""


@lru_cache(4096)
def parse_override(override: str) -> Any:
    """Parse an override with Hydra."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create().parse_overrides([override])[0]


_one_at_a_time = RLock()
"""Lock for Hydra, which keeps its search path in a variable of the process."""


def list_texts(overrides: Iterable[str]) -> list[str]:
    """List overrides given from Python, in any iterable; raises BadInput unless each is a text."""
    is_list = isinstance(overrides, Iterable) and not isinstance(overrides, str)
    require(is_list, "overrides", overrides, 'must be a list of texts, such as ["cycles=3"]')
    texts = list(overrides)
    for text in texts:
        require(isinstance(text, str), "overrides", text, 'must be a text, such as "cycles=3"')
    return texts


def expand_grid(overrides: Sequence[Any], most: int | None) -> list[list[list[str]]]:
    """List the overrides of each job of a grid, in batches of at most ``most`` jobs; None: in one batch.

    ``overrides`` are those of the sweep, as Hydra parses them. Raises BadInput for an override that gives an interval
    instead of a list of values.
    """
    values: dict[str, list[str]] = {}
    for override in overrides:
        key = override.get_key_element()
        if not override.is_sweep_override():
            values[key] = [override.get_value_element_as_str()]
        elif override.is_discrete_sweep():
            values[key] = list(override.sweep_string_iterator())
        else:
            interval = str(override.input_line).partition("=")[2]
            raise BadInput(
                key, interval, "must list values: 8,16 or range(8,16); a sweeper that searches takes intervals"
            )
    texts = [[f"{key}={value}" for value in swept] for key, swept in values.items()]  # which jobs share
    jobs = [list(job) for job in product(*texts)]
    most = most or len(jobs)
    return [jobs[first : first + most] for first in range(0, len(jobs), most)]


def refuse_options(overrides: Iterable[str]) -> None:
    """Raise BadInput if an override given from Python is an option of the command line."""
    for text in overrides:
        is_option = text.startswith(("-", "hydra.", "hydra/"))
        require(not is_option, "overrides", text, "is an option of the command line; give config overrides only")


def set_values(config: DictConfig, overrides: Iterable[str]) -> None:
    """Set values in a composed config, as Hydra does after it has composed the options of the groups."""
    for override in map(parse_override, overrides):
        adds = override.is_add() or override.is_force_add()
        OmegaConf.update(config, override.key_or_group, override.value(), merge=True, force_add=adds)


def _compose(overrides: Sequence[str]) -> tuple[DictConfig, dict[str, str]]:
    """Compose a config with Hydra; returns it and the chosen option of each group."""
    from hydra import compose, initialize_config_dir  # takes 60 ms, not needed to load a sweep

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
    """Split overrides into those that choose options of groups and those that set values, both in their order.

    Hydra itself composes options before it sets values, regardless of the order of overrides. A dictionary sets
    values of a group. If an override removes a key or names a package, Hydra has to process all overrides together:
    all are returned as the first part.
    """
    options: list[str] = []
    values: list[str] = []
    for text in overrides:
        key, _, value = text.partition("=")
        if key.startswith("~") or "@" in key:
            return tuple(overrides), []
        is_option = is_group(key.lstrip("+")) and not value.lstrip().startswith("{")
        (options if is_option else values).append(text)
    return tuple(options), values


@lru_cache(1 << 10)
def _pickle_options(options: tuple[str, ...]) -> bytes:
    """Compose a config from options only, as :func:`_compose`, and pickle the result.

    Cached, since Hydra takes longer to read some 30 files than most runs take; pickled, since nothing copies a config
    faster.
    """
    return pickle.dumps(_compose(options))


def _compose_cached(overrides: Sequence[str]) -> tuple[DictConfig, dict[str, str]]:
    """Compose a config as :func:`_compose`, from the cached result for its options in which values are then set."""
    from hydra.core.override_parser.types import OverrideType

    options, values = split_overrides(overrides)
    config, choices = pickle.loads(_pickle_options(options))
    for text in values:
        override = parse_override(text)
        former = OmegaConf.select(config, override.key_or_group, default=_MISSING, throw_on_resolution_failure=False)
        valid_types = (OverrideType.ADD if former is _MISSING else OverrideType.CHANGE, OverrideType.FORCE_ADD)
        if override.type not in valid_types or override.is_sweep_override():
            return _compose(overrides)  # raises the error of Hydra
        set_values(config, [text])
    return config, choices


def compose_config(overrides: Sequence[str], config_dir: str | Path | None = None, is_shared: bool = False) -> Config:
    """Compose and check the config of a command line, e.g. ``["scenario=one_leg", "cycles=3"]``.

    Args:
        overrides: Overrides as on the command line.
        config_dir: Folder of custom configs, as ``--config-dir``; its files are read again by each call.
        is_shared: True if the caller does not change the config, which then may share groups with other configs.

    Raises:
        CmacexpError: With the message of the command line.
    """
    options, values = split_overrides(overrides)
    count = max((index for index, text in enumerate(values, 1) if not _PLAIN.fullmatch(text)), default=0)
    first = _compose_first((*options, *values[:count])) if config_dir is None else None
    if first is None or (config := set_plain_values(first[0], values[count:], first[1])) is None:
        return to_config(compose_untyped(overrides, config_dir)[0])
    if not isinstance(config, Config):
        return to_config(config)
    return config if is_shared else pickle.loads(pickle.dumps(config))  # type: ignore[no-any-return]


@exits_caught()  # the check of a component may call exit
def set_plain_values(base: Any, overrides: Iterable[str], referred: frozenset[str] = frozenset()) -> Any:
    """Return a copy of a config with plain values set, such as ``learning.rate=0.5``, without Hydra.

    Takes a twentieth of the time that Hydra's grammar and OmegaConf take for such overrides, the only ones of most
    runs. Returns None if an override does anything else, or if a typed config is invalid with these numbers; then the
    config must be composed by Hydra, which also finds the first error.

    Args:
        base: Typed :class:`Config`, plain dictionaries, or either of them pickled; of one that is not pickled the
            copy shares the unchanged groups.
        overrides: Overrides that set numbers, words in lower case, or lists of these.
        referred: Groups, and keys outside groups, to which other values refer; values in them cannot be set here.
    """
    config = pickle.loads(base) if isinstance(base, bytes) else copy(base)
    with suppress(BadInput):
        for text in overrides:
            if (match := _PLAIN.fullmatch(text)) is None:
                return None
            *path, name = match[1].split(".")
            owner = config
            for key in path:
                values = _list_values(owner)
                values[key] = owner = copy(values.get(key))
            texts = match[2][1:-1].split(",") if match[2][0] == "[" else None
            value = parse_value(match[2]) if texts is None else [parse_value(text.strip()) for text in texts]
            values = _list_values(owner)
            former = values.get(name, {})
            is_group = isinstance(former, dict) or is_dataclass(former)
            needs_list = isinstance(former, list) and not isinstance(value, list)
            if is_group or needs_list or (*path, name)[0] in referred:
                return None
            values[name] = value if owner is values else read_field(type(owner), name, value, match[1])
        if isinstance(config, Config):
            check(config)
        return config
    return None


def parse_value(text: str) -> Any:
    """Parse a value as typed on the command line: a number, true, false, null, else text."""
    if text.lower() in ("true", "false"):  # Hydra writes True and False into the overrides of jobs
        return text.lower() == "true"
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return None if text == "null" else text.strip("'\"")


def _list_values(node: Any) -> dict[str, Any]:
    """List the values of a group of fields, by name; empty if ``node`` is no group."""
    return node if isinstance(node, dict) else vars(node) if is_dataclass(node) else {}


@lru_cache(64)
def _compose_first(overrides: tuple[str, ...]) -> tuple[Config | bytes, frozenset[str]] | None:
    """Compose the base config for :func:`set_plain_values`; returns it with the result of :func:`find_referred`.

    ``overrides`` are those up to the last one that sets no plain value. If they name a class the config is plain
    and pickled, since a user may redefine the class. Returns None if they, or their options without the values, give
    no valid config, or if its references are not known.
    """
    options, _ = split_overrides(overrides)
    if options != overrides and _compose_first(options) is None:
        return None
    try:
        config = _compose_cached(overrides)[0]
        base: Config | bytes = to_config(config)
        if any("_target_" in text for text in overrides):
            base = pickle.dumps(OmegaConf.to_container(config, resolve=True, enum_to_str=True))
    except Exception:  # of any kind: the composition by Hydra raises it again, with a message
        return None
    return None if (referred := find_referred(config)) is None else (base, referred)


def find_referred(config: DictConfig) -> frozenset[str] | None:
    """Find the groups, and keys outside groups, to which values of a config refer; None if not determinable."""
    references = re.findall(r"\$\{([^}]*)", str(OmegaConf.to_container(config)))
    if not all(re.fullmatch(r"rule:\w+|[a-z]\w*\.[\w.]+", name) for name in references):
        return None
    return frozenset().union(*(READ if name[:5] == "rule:" else {name.partition(".")[0]} for name in references))


def compose_untyped(
    overrides: Sequence[str], config_dir: str | Path | None = None
) -> tuple[DictConfig, dict[str, str]]:
    """Compose a config, neither typed nor checked, for :func:`cmacexp.config.to_config`.

    Returns it and the chosen option of each group, e.g. ``{"feedforward": "cmac"}``. ``config_dir`` is a folder of
    custom configs. Raises CmacexpError if Hydra cannot compose the config.
    """
    from cmacexp.config.explain import explain_composition

    require(config_dir is None or Path(config_dir).is_dir(), "config_dir", config_dir, "is no folder")
    try:
        if config_dir is None:
            return _compose_cached(overrides)
        return _compose([*overrides, f"hydra.searchpath=[file://{Path(config_dir).resolve()}]"])
    except Exception as error:  # of any kind: for a null among options, for example, Hydra raises a TypeError
        raise find_mistake(error) or CmacexpError(explain_composition(error, overrides)) from None


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]  # CSafeDumper is six times as fast
    """Writer of YAML for OmegaConf, which reads more texts as numbers than YAML does."""

    def represent_text(self, text: str) -> yaml.ScalarNode:
        """Represent a text, in quotes unless it begins with a letter."""
        return self.represent_scalar("tag:yaml.org,2002:str", text, None if text[:1].isalpha() else "'")


_Dumper.add_representer(str, _Dumper.represent_text)


@lru_cache(1 << 10)
def _dump(packed: bytes) -> str:
    """Convert a pickled value to YAML; cached, since writing all groups for each job takes as long as a run."""
    return yaml.dump(pickle.loads(packed), Dumper=_Dumper, sort_keys=False)  # type: ignore[no-any-return]


def make_record(composed: Node, hydra: Node) -> dict[str, str]:
    """Make the files, text by name, that Hydra writes unless ``hydra.output_subdir`` is null.

    Args:
        composed: Config without ``hydra``.
        hydra: Hydra's own config.
    """
    plain: Iterator[Any] = (
        OmegaConf.to_container(node, enum_to_str=True) if isinstance(node, DictConfig) else node
        for node in (composed, hydra)
    )
    config, hydra_config = plain
    groups = [_dump(pickle.dumps({"hydra": {key: value}})) for key, value in hydra_config.items()]
    return {
        "config.yaml": "".join(_dump(pickle.dumps({key: value})) for key, value in config.items()),
        "hydra.yaml": "hydra:\n" + "".join(text.removeprefix("hydra:\n") for text in groups),
        "overrides.yaml": _dump(pickle.dumps(hydra_config["overrides"]["task"])),
    }
