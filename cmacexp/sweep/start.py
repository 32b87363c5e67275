"""What happens when a sweep starts: its folder is noted, ``record=trace`` is the default, composing is made quick."""

import contextlib
import pickle
import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.experimental.callback import Callback
from hydra.plugins.sweeper import Sweeper
from omegaconf import DictConfig, OmegaConf

from cmacexp.errors import BadInput

DEFAULT = "record=trace"
"""Override of a sweep that says nothing of ``record``."""


class Sweep:
    """The sweep of this process.

    Attributes:
        folder: ``hydra.sweep.dir``.
        planned: how many jobs have which overrides, see :func:`without_sweep`.
        refused: why no job may start, if so.
    """

    def __init__(self, folder: Path, refused: BadInput | None):
        self.folder = folder
        self.planned: Counter[tuple[str, ...]] = Counter()
        self.refused = refused
        self._composable: set[tuple[str, ...]] = set()

    def check(self, sweeper: Any, batch: Sequence[Sequence[str]]) -> None:
        """Note the next jobs, and tell before the first one starts if one of them cannot be composed.

        Whether it can depends on the keys and on the options chosen: of jobs that differ in values alone, which can
        be thousands, one is composed.

        Raises:
            BadInput: the sweep cannot be taken up again.
            HydraException: what Hydra says of a job that cannot be composed.
        """
        if self.refused is not None:
            raise self.refused
        loader = sweeper.hydra_context.config_loader
        is_group = cache(loader.repository.group_exists)
        for overrides in batch:
            self.planned[tuple(without_sweep(overrides))] += 1
            keys = [text.split("=")[0] for text in overrides]
            kind = tuple(text if is_group(key) else key for text, key in zip(overrides, keys, strict=True))
            if kind not in self._composable:
                loader.load_sweep_config(sweeper.config, list(overrides))
                self._composable.add(kind)


class _KeptFiles:
    """Hydra's source of configs, that reads each file once; in the place of the one that reads it for every job."""

    def __init__(self, repository: Any, kept: dict[str, bytes]):
        self.repository = repository
        self.kept = kept

    def __getattr__(self, name: str) -> Any:
        return getattr(self.repository, name)

    def __deepcopy__(self, memo: object) -> "_KeptFiles":
        return self  # Hydra copies the source for every job

    def __reduce__(self) -> tuple[Any, ...]:
        return _KeptFiles, (self.repository, self.kept)

    def load_config(self, config_path: str) -> Any:
        """What the file holds, new for each caller, who may change it."""
        if config_path in self.kept:
            return pickle.loads(self.kept[config_path])
        loaded = self.repository.load_config(config_path=config_path)
        with contextlib.suppress(pickle.PicklingError):  # as with the schemas of plugins in a worker
            self.kept[config_path] = pickle.dumps(loaded)
        return loaded


def _keys(overrides: Sequence[str]) -> set[str]:
    return {text.split("=")[0].lstrip("+") for text in overrides}


def without_sweep(overrides: Sequence[str]) -> list[str]:
    """The overrides that tell of the run itself, not of how the sweep goes about it."""
    return [text for text in overrides if re.split(r"[=./]", text)[0] not in ("sweep", "optimize", "hydra")]


def _refusal(config: DictConfig) -> BadInput | None:
    """Why this sweep cannot be taken up again, if it is to be."""
    if OmegaConf.select(config, "sweep.resume") is True and "hydra.sweep.dir" not in _keys(
        config.hydra.overrides.hydra
    ):
        return BadInput("sweep.resume", True, "needs the folder of the sweep to resume: add hydra.sweep.dir=DIR")
    return None


class SweepStart(Callback):
    """Hydra tells this when a sweep starts; see ``hydra.callbacks`` in ``conf/config.yaml``."""

    sweep: Sweep | None = None
    """The sweep that this process started."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Set the sweep up, before its jobs are made."""
        searched = OmegaConf.select(config, "hydra.sweeper.params") or {}
        given = {*_keys(config.hydra.overrides.task), *map(str, searched)}
        if "record" not in given:
            config.hydra.overrides.task.append(DEFAULT)
        sweep = Sweep(Path(config.hydra.sweep.dir), _refusal(config))
        hydra: Any = GlobalHydra.instance().hydra
        hydra.config_loader.repository = _KeptFiles(hydra.config_loader.repository, {})
        checks: Any = Sweeper  # where all sweepers have the check from, that composes each job a first time
        checks.validate_batch_is_legal = lambda sweeper, batch: sweep.check(sweeper, batch)
        SweepStart.sweep = sweep
