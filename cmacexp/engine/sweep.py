"""A sweep: its options are checked, its jobs are composed before anything runs, and then run as its launcher says."""

import pickle
import shutil
from collections import defaultdict
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from enum import Enum
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config.explain import COMPOSITION_ERRORS
from cmacexp.config.hydra_private import BASIC, GRID, expand_grid
from cmacexp.config.robot_rule import read_machine
from cmacexp.data.folder import collection
from cmacexp.data.manifest import JOBS_FOLDER
from cmacexp.engine.objective import DIRECTION, check_metric, find_direction, read_objective
from cmacexp.engine.pool import (
    MOST_RUNS,
    ParallelMap,
    choose_size,
    count_processes,
    group_runs,
    map_here,
    start_workers,
)
from cmacexp.engine.sweep_results import finish_sweep
from cmacexp.engine.sweep_tables import HASHES, list_jobs, select_run_overrides
from cmacexp.errors import BadInput, CmacexpError, in_one_line
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.terminal.messages import warn_of_models
from cmacexp.terminal.output import print_line
from cmacexp.typing import Status

SWEEP_KEY, SUBDIR = "hydra.sweep.dir", "${hydra.job.num}"
CORES = "hydra_plugins.cmacexp_launcher.CoresLauncher"
COUNTS = ("sweep.chunk", "hydra.launcher.processes", "hydra.sweeper.max_batch_size")
"""Options of a sweep that are numbers, at least 1, or null."""
DEFAULT = "record=trace"
"""Override of a sweep that does not set ``record``."""


class Sweep:
    """The jobs of a sweep, and how they end.

    Args:
        config: what Hydra composes for the sweep.
        context: of Hydra, which composes the jobs.

    Raises:
        BadInput: an option of the sweep is wrong.
        HydraException: a job cannot be composed; Hydra and OmegaConf raise other errors too.
    """

    def __init__(self, config: DictConfig, context: HydraContext):
        self.config, self.context, self.folder = config, context, Path(config.hydra.sweep.dir)
        self.planned: list[tuple[str, ...]] = []
        """Overrides of the run of each job, see :func:`select_run_overrides`."""
        self.size, self.launched = 1, 0
        """Jobs without folders that a process takes at a time, at most; and those of the current batch."""
        self.templates: dict[tuple[str, ...], tuple[bytes, bool]] = {}
        """Arguments ``packed`` of :func:`cmacexp.engine.job.run_jobs`, by what jobs have in common, and whether a
        process takes several of these jobs at a time: those that keep metrics alone, and are no robot's."""
        self.list_options = cache(context.config_loader.get_group_options)
        """Of a key; a field has none. Hydra takes longer to list them than to run a job."""
        self.parallel_map: ParallelMap = map_here
        self.optimize, self.direction = _read_objective(config)
        _check_options(config)
        self.batches: list[list[list[str]]] = self._expand()
        """Overrides of the jobs, if they are known before the first of them runs."""
        for batch in self.batches:
            self._plan(batch)

    def _expand(self) -> Any:
        """The batches of the grid of Hydra's own sweeper; raises BadInput if a key is swept over no value."""
        sweeper, typed = self.config.hydra.sweeper, _read_typed(self.config)
        searched = [f"{key}={value}" for key, value in (sweeper.get("params") or {}).items()]
        if "record" not in _list_keys([*searched, *typed]):
            self.config.hydra.overrides.task.append(DEFAULT)
            typed.append(DEFAULT)
        parser = OverridesParser.create(config_loader=self.context.config_loader)
        overrides = parser.parse_overrides([*searched, *typed])
        for override in overrides:
            if override.is_discrete_sweep() and next(iter(override.sweep_iterator()), None) is None:
                key, _, value = str(override.input_line).partition("=")
                raise BadInput(key, value, "matches no option; glob is for groups, a field takes values: 8,16")
        return expand_grid(overrides, sweeper.max_batch_size) if sweeper._target_ == GRID else []

    def _plan(self, batch: Sequence[Sequence[str]]) -> None:
        """Note jobs, and compose one of each kind."""
        for overrides in batch:
            self.planned.append(tuple(select_run_overrides(overrides)))
            self._pack(overrides)

    def _pack(self, overrides: Sequence[str]) -> tuple[tuple[bytes, bool], list[str]]:
        """What Hydra composes for a job, and the overrides that set values in it.

        Jobs that differ in such values alone, which can be thousands, are composed once: whether that is possible
        depends on their keys and on the options that they choose. See ``benchmarks/sweep.py``.
        """
        keys = [text.partition("=")[0] for text in overrides]
        values = [
            text
            for text, key in zip(overrides, keys, strict=True)
            if not (key[0] in "+~" or "@" in key or "{" in text or self.list_options(key))
        ]
        kind = tuple(key if text in values else text for text, key in zip(overrides, keys, strict=True))
        if kind not in self.templates:
            composed = self.context.config_loader.load_sweep_config(self.config, list(overrides))
            if is_robot := composed.machine.get("kind") == "robot":
                with suppress(BadInput, OmegaConfBaseException):  # which the job reports
                    warn_of_models([read_machine(composed)])
            needs_hydra, record = _needs_hydra(composed), composed.record
            packed = pickle.dumps((composed, self.context.callbacks, self.folder.absolute(), needs_hydra))
            self.templates[kind] = packed, not (is_robot or needs_hydra or record.trace or record.weights)
        return self.templates[kind], values

    def run(self) -> str:
        """Run all jobs, and print and write their table.

        Returns how the sweep ended, see :func:`cmacexp.engine.sweep_results.finish_sweep`; ``failed`` if it could not
        go on. Raises BadInput if the folder cannot be used, and KeyboardInterrupt after an interrupt.
        """
        with collection(self.folder, SWEEP_KEY):
            if not self.config.sweep.resume:
                shutil.rmtree(self.folder / JOBS_FOLDER, ignore_errors=True)
            try:
                with self._start() as self.parallel_map:
                    self._run_jobs()
            except (KeyboardInterrupt, Exception) as error:
                is_wrong = isinstance(error, (CmacexpError, *COMPOSITION_ERRORS))
                if is_interrupt(error):
                    self._finish()
                if is_wrong or is_interrupt(error):
                    raise
                reason = in_one_line(str(error).strip() or type(error).__name__)
                print_line(f"error: the sweep ended early: {reason}", error=True)
                self._finish()
                return Status.FAILED
            return self._finish()

    def _finish(self) -> str:
        return finish_sweep(self.folder, self.planned, self.optimize, self.direction)

    def _start(self) -> AbstractContextManager[ParallelMap]:
        """Start what the launcher stands for."""
        launcher, size = self.config.hydra.launcher, self.config.sweep.chunk or 1
        if launcher._target_ == CORES:
            self.size = choose_size(max(map(len, self.batches), default=1), count_processes(launcher.processes))
            return start_workers(launcher.processes)
        if launcher._target_ == BASIC:
            return nullcontext(map_here)
        from cmacexp.engine.cluster import make_map

        self.size = min(size, MOST_RUNS)
        return nullcontext(make_map(self.config.copy(), self.context, lambda items: -(-self.launched // size)))

    def _run_jobs(self) -> None:
        if self.batches:
            OmegaConf.save(self.config, self.folder / "multirun.yaml")
            for first, batch in zip(accumulate(map(len, self.batches), initial=0), self.batches, strict=False):
                self.launch(batch, first)
            return
        self.config.hydra.launcher = {"_target_": CORES}
        sweeper = Plugins.instance().instantiate_sweeper(
            config=self.config,
            hydra_context=self.context,
            task_function=self,  # type: ignore[arg-type]  # for its launcher
        )
        sweeper.sweep(_read_typed(self.config))

    def launch(self, batch: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
        """Run the jobs of a batch, whose first has the number ``first``; what they return, in their order."""
        if not self.batches:
            self._plan(batch)
        self.launched, known, alike = len(batch), {}, defaultdict[tuple[bytes, bool], list[Any]](list)
        if self.config.sweep.resume:
            known = {(run.read("run"), run.read("overrides")): run for run in list_jobs(self.folder)}
        for number, overrides in enumerate(batch, first):
            template, values = self._pack(overrides)
            run = known.get((number, " ".join(self.planned[number])))
            hashes = tuple(map(run.read, HASHES)) if run is not None and run.outcome.is_result else ()
            alike[template].append((list(overrides), values, number, hashes))
        items = [
            (packed, [own[index] for index in chunk], len(self.planned))
            for (packed, together), own in alike.items()
            for chunk in group_runs([values for _, values, *_ in own], self.size if together else 1)
        ]
        items.sort(key=lambda item: item[1][0][2])  # by the number of the first job
        self.parallel_map("sweep", _run_jobs, items, self._see, len(batch))
        ended = [JobReturn(status=JobStatus.COMPLETED) for _ in batch]
        if self.optimize and not self.batches:  # else no sweeper waits for it
            by_number = {run.read("run"): run for run in list_jobs(self.folder)}
            for number, returned in enumerate(ended, first):
                returned.return_value = read_objective(self.optimize, by_number[number], self.direction)
        return ended

    def _see(self, ends: Any) -> None:
        for text, is_error in ends:
            print_line(text, error=is_error)


def _run_jobs(packed: bytes, items: Sequence[Any], jobs: int) -> Any:
    from cmacexp.engine.job import JobItem, run_jobs  # here, because the process of the sweep needs nothing of that

    return run_jobs(packed, [JobItem(*item) for item in items], jobs)


def _needs_hydra(composed: DictConfig) -> bool:
    """Whether only Hydra's own run of a job gives what a config asks for; it copies the config four times."""
    plain: Any = OmegaConf.to_container(composed, enum_to_str=True)
    hydra = plain.pop("hydra")
    job, text = hydra["job"], str(plain)
    asked = hydra["callbacks"], job["chdir"], job["env_set"], hydra["output_subdir"], hydra["job_logging"]["root"]
    return hydra["sweep"]["subdir"] != SUBDIR or any(asked) or "${hydra" in text or "???" in text


def _check_options(config: DictConfig) -> None:
    for key in COUNTS:
        value = OmegaConf.select(config, key)
        if value is not None and (type(value) is not int or value < 1):
            raise BadInput(key, value, "must be at least 1, or null")
    if config.sweep.resume is True and SWEEP_KEY not in _list_keys(config.hydra.overrides.hydra):
        raise BadInput("sweep.resume", True, "needs the folder of the sweep to resume: add hydra.sweep.dir=DIR")
    if config.sweep.chunk and config.hydra.launcher._target_ == CORES:
        allowed = "is for a launcher that starts a process for each job; use hydra/launcher=submitit_slurm, or null"
        raise BadInput("sweep.chunk", config.sweep.chunk, allowed)


def _read_objective(config: DictConfig) -> tuple[str | None, str | None]:
    """The metric that ``optimize`` names, and what is done with it, which a sweeper that searches is set to.

    Raises BadInput, see :func:`cmacexp.engine.objective.find_direction`.
    """
    name, searches = config.optimize, "direction" in config.hydra.sweeper
    if name is None and not searches:
        return None, None
    check_metric(name if name is None else str(name), "robot")  # which has all; a job knows its own machine
    given = OmegaConf.select(config, DIRECTION)
    typed = None if isinstance(given, Enum) else given  # the default of the sweeper is a member of its own Enum
    direction = find_direction(name, typed, searches)
    if searches and typed is None:
        config.hydra.sweeper.direction = direction
        config.hydra.overrides.hydra.append(f"{DIRECTION}={direction}")  # the record of jobs has it there
    return name, direction


def _read_typed(config: DictConfig) -> list[str]:
    """The overrides of jobs as typed: an interpolation in them is one of each job, not of the sweep."""
    typed: Any = OmegaConf.to_container(config.hydra.overrides.task, resolve=False)
    return list(typed)


def _list_keys(overrides: Sequence[str]) -> set[str]:
    return {text.partition("=")[0].lstrip("+") for text in overrides}
