"""The start of a sweep: record its folder and jobs, set ``record=trace`` by default, read each config file once."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from functools import cache
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import RangeSweep
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from hydra.plugins.sweeper import Sweeper
from omegaconf import DictConfig, OmegaConf

from cmacexp.config.hydra_private import read_config_files_once
from cmacexp.errors import BadInput

if TYPE_CHECKING:
    from cmacexp.data.folder import Place
    from cmacexp.experiment.workers import RunAll

SWEEP_KEY = "hydra.sweep.dir"
DEFAULT = "record=trace"
"""Override of a sweep that does not set ``record``."""


class Kind(NamedTuple):
    """Jobs that differ in values alone."""

    composed: DictConfig
    """What Hydra composes for the first of them."""
    first: Sequence[str]
    """Overrides of that job."""
    runs: list[list[str]]
    """Overrides of the run of each job."""


class Sweep:
    """The sweep of this process.

    Attributes:
        folder: ``hydra.sweep.dir``.
        place: the same once it is locked, for the table.
        planned: how many jobs have which overrides, see :func:`select_run_overrides`.
        kinds: of jobs, see :meth:`get_kind`.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self.place: Place | None = None
        self.planned: Counter[tuple[str, ...]] = Counter()
        self.kinds: dict[tuple[str, ...], Kind] = {}
        self.run_all: RunAll | None = None
        self.lock, self.progress = ExitStack(), ExitStack()
        """Left when the sweep is over, and when its jobs are."""

    def begin(self) -> None:
        """Keep other sweeps out of the folder, and show how many jobs are done.

        Raises:
            BadInput: another sweep runs there, or tables in it are not those of a sweep.
            OSError: the folder cannot be written.
        """
        from cmacexp.data.folder import replacing  # here, because every command imports this file
        from cmacexp.data.manifest import SWEEP
        from cmacexp.experiment.workers import shared_progress

        self.place = self.lock.enter_context(replacing(self.folder, SWEEP_KEY, SWEEP))
        self.progress.enter_context(shared_progress("sweep", self.planned.total, "jobs"))

    def start_workers(self, processes: int | None) -> "RunAll":
        """Start the processes that run jobs, as many as there are cores unless so many are asked for; once."""
        from cmacexp.experiment.workers import start_pool

        if self.run_all is None:
            self.run_all = self.progress.enter_context(start_pool(processes))
        return self.run_all

    def get_kind(self, caller: Any, overrides: Sequence[str]) -> Kind:
        """The kind of a job: whether it can be composed depends on its keys and on the options that it chooses.

        Jobs that differ in values alone, which can be thousands, are of one kind, composed once. See
        ``benchmarks/sweep.py``.

        Args:
            caller: a sweeper or launcher, which Hydra has set up.
            overrides: of the job.

        Raises:
            HydraException: it cannot be composed.
        """
        loader = caller.hydra_context.config_loader
        keys = [text.split("=")[0] for text in overrides]
        changes = [key[0] in "+~" or "@" in key or _is_group(loader, key) for key in keys]
        kind = tuple(text if change else key for text, key, change in zip(overrides, keys, changes, strict=True))
        if kind not in self.kinds:
            try:
                composed = loader.load_sweep_config(caller.config, list(overrides))
            except (TypeError, ValueError) as error:  # of overrides whose shape Hydra does not foresee
                raise HydraException(str(error)) from error
            self.kinds[kind] = Kind(composed, overrides, [])
        return self.kinds[kind]

    def check(self, sweeper: Any, batch: Sequence[Sequence[str]]) -> None:
        """Note the next jobs, before they start, and compose one of each kind.

        Raises:
            HydraException: a job cannot be composed.
        """
        for overrides in batch:
            self.planned[tuple(select_run_overrides(overrides))] += 1
            self.get_kind(sweeper, overrides).runs.append(select_run_overrides(overrides))


@cache
def _is_group(loader: Any, key: str) -> bool:
    """Whether a key chooses an option."""
    return bool(loader.get_group_options(key))


class SweepRefused(BaseException):
    """A sweep cannot start, for the error that it is made with; Hydra ignores an ``Exception`` of a callback."""


class SweepStart(Callback):
    """Called by Hydra when a sweep starts; see ``hydra.callbacks`` in ``conf/config.yaml``."""

    sweep: Sweep | None = None
    """The sweep that this process started."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Prepare the sweep, before its jobs are made."""
        sweep = Sweep(Path(config.hydra.sweep.dir))
        try:
            _check_size(config)
            sweep.begin()
        except (BadInput, OSError, HydraException) as error:
            raise SweepRefused(error) from error
        SweepStart.sweep = sweep
        typed = _keys(config.hydra.overrides.task)
        searched = map(str, OmegaConf.select(config, "hydra.sweeper.params") or {})
        if "record" not in {*typed, *searched}:
            config.hydra.overrides.task.append(DEFAULT)
        has_folder = "hydra.sweep.dir" in _keys(config.hydra.overrides.hydra)
        lacks_folder = OmegaConf.select(config, "sweep.resume") is True and not has_folder

        def check(sweeper: Sweeper, batch: Sequence[Sequence[str]]) -> None:
            if lacks_folder:  # is raised here because Hydra ignores what a callback raises
                allowed = "needs the folder of the sweep to resume: add hydra.sweep.dir=DIR"
                raise BadInput("sweep.resume", True, allowed)
            sweep.check(sweeper, batch)

        Sweeper.validate_batch_is_legal = check  # type: ignore[method-assign, assignment]  # called by all sweepers
        read_config_files_once(GlobalHydra.instance().hydra)


def _check_size(config: DictConfig) -> None:
    """Count the jobs, before Hydra makes a list of them.

    Raises:
        BadInput: there are none, or more than ``sweep.max_jobs``.
        HydraException: an override cannot be read.
    """
    limit, jobs = config.sweep.max_jobs, 1
    if not isinstance(limit, int):
        raise BadInput("sweep.max_jobs", limit, "must be a whole number, at least 1")
    searched = [f"{key}={value}" for key, value in (OmegaConf.select(config, "hydra.sweeper.params") or {}).items()]
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    for override in parser.parse_overrides([*searched, *config.hydra.overrides.task]):
        if override.is_discrete_sweep():
            value = override.value()
            values = value.range() if isinstance(value, RangeSweep) else override.sweep_string_iterator()
            count = sum(1 for _ in islice(values, limit + 1))
            if not count:
                typed = str(override.input_line).partition("=")
                raise BadInput(
                    typed[0], typed[2], "matches no option; glob is for groups, a field takes values: 8,16"
                )
            jobs *= count
    if jobs > limit:
        raise BadInput("sweep.max_jobs", limit, f"the sweep has more than {limit} jobs; raise it if they are meant")


def count_jobs() -> float:
    """Jobs of the sweep that this process started; infinite in a process of another launcher, which cannot know."""
    return SweepStart.sweep.planned.total() if SweepStart.sweep is not None else math.inf


def _keys(overrides: Sequence[str]) -> set[str]:
    return {text.split("=")[0].lstrip("+") for text in overrides}


def select_run_overrides(overrides: Sequence[str]) -> list[str]:
    """The overrides of the run, without those of the sweep."""
    return [text for text in overrides if re.split(r"[=./]", text)[0] not in ("sweep", "optimize", "hydra")]
