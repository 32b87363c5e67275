"""A sweep: its options are checked, its jobs are composed before anything runs, and then run as its launcher says.

At its end its table, one row per job, is written and printed.
"""

import pickle
from collections import Counter, defaultdict
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from enum import Enum
from functools import cache
from itertools import accumulate, chain
from pathlib import Path
from secrets import token_hex
from typing import Any

import numpy as np
import pyarrow.csv as pa_csv
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config.compose import expand_grid, split_overrides
from cmacexp.config.explain import COMPOSITION_ERRORS
from cmacexp.config.robot_rule import read_machine
from cmacexp.data import manifest as manifests
from cmacexp.data.files import full_disk_named, sha256, write_atomically
from cmacexp.data.folder import SETTINGS, TABLE, TABLE_CSV, collection, make_sweep_manifest
from cmacexp.data.tables import METRICS_FILE, as_array, select_rows, write_table
from cmacexp.engine.job_store import (
    FINGERPRINT,
    HASHES,
    JobItem,
    JobRun,
    JobTables,
    list_jobs,
    list_whole,
    write_part,
)
from cmacexp.engine.objective import DIRECTION, check_metric, describe_best, find_direction, read_objective
from cmacexp.engine.pool import (
    MOST_RUNS,
    ParallelMap,
    choose_size,
    count_processes,
    iterate_here,
    start_workers,
)
from cmacexp.engine.sweep_tables import collect_settings, read_settings, select_run_overrides, tabulate_settings
from cmacexp.engine.without_effect import join_idle
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.terminal.messages import describe_resume, print_next, print_runs, warn_of_models, warn_of_other_mode
from cmacexp.terminal.output import print_line, show_activity
from cmacexp.typing import Status

SWEEP_KEY, SUBDIR = "hydra.sweep.dir", "${hydra.job.num}"
BASIC, CORES = "basic", "cores"
"""Hydra's own sweeper, whose jobs are known before the first one runs, and its own launcher; ours."""
COUNTS = ("sweep.chunk", "hydra.launcher.processes", "hydra.sweeper.max_batch_size")
"""Options of a sweep that are numbers, at least 1, or null."""
ONLY_OF_RUNS = ("callbacks", "job.chdir", "job.env_set", "output_subdir", "job_logging.root")
"""What Hydra does around a single run; so many jobs share a process."""
DEFAULT = "record=trace"
"""Override of a sweep that does not set ``record``."""
MAX_LISTED_FAILURES = 20


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
        self.name = token_hex(4)
        """What the parts of its tables are called by."""
        self.earlier: list[Path] = []
        """What earlier sweeps have left that this one resumes."""
        self.planned: list[tuple[str, ...]] = []
        """Overrides of the run of each job, see :func:`select_run_overrides`."""
        self.places: list[str] = []
        """Folders of these jobs, in that of the sweep."""
        self.size = 1
        """Jobs without folders that a process takes at a time, at most."""
        self.templates: dict[tuple[str, ...], tuple[bytes, bool]] = {}
        """Arguments ``packed`` of :func:`cmacexp.engine.job.run_jobs`, by what jobs have in common, and whether a
        process takes several of these jobs at a time: those that keep metrics alone, and are no robot's."""
        self.list_options = cache(context.config_loader.get_group_options)
        """Lists the options of a key; a field has none. Hydra takes longer to list them than to run a job."""
        self.parallel_map: ParallelMap = iterate_here
        self.optimize, self.direction = _read_objective(config)
        _check_options(config)
        self.batches: list[list[list[str]]] = self._expand()
        """Overrides of the jobs, if they are known before the first of them runs."""
        for batch in self.batches:
            self._plan(batch)

    def _expand(self) -> Any:
        """The batches of the grid of Hydra's own sweeper; raises BadInput if a key is swept over no value."""
        sweeper, typed = self.config.hydra.sweeper, _read_typed(self.config.hydra.overrides.task)
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
        return expand_grid(overrides, sweeper.max_batch_size) if _read_choice(self.config, "sweeper") == BASIC else []

    def _plan(self, batch: Sequence[Sequence[str]]) -> None:
        """Note jobs, and compose one of each kind; raises BadInput if two have the same folder."""
        typed: Any = OmegaConf.to_container(self.config.hydra.sweep, resolve=False)
        for overrides in batch:
            number = len(self.planned)
            is_own = typed["subdir"] == SUBDIR
            self.places.append(str(number) if is_own else self._find_place(overrides, number, typed["subdir"]))
            self.planned.append(tuple(select_run_overrides(overrides)))
            self._pack(overrides)

    def _find_place(self, overrides: Sequence[str], number: int, typed: str) -> str:
        """The folder of a job, as the user names it; raises BadInput if an earlier one has it."""
        composed = self.context.config_loader.load_sweep_config(self.config, list(overrides))
        with read_write(composed.hydra), open_dict(composed.hydra):
            composed.hydra.job.num, composed.hydra.job.id = number, str(number)
        place = str(composed.hydra.sweep.subdir)
        require(
            place not in self.places,
            "hydra.sweep.subdir",
            typed,
            f"must differ for each job, e.g. {SUBDIR}",
        )
        return place

    def _pack(self, overrides: Sequence[str]) -> tuple[tuple[bytes, bool], list[str]]:
        """What Hydra composes for a job, and the overrides that set its values in it.

        Jobs that differ in such values alone, which can be thousands, are composed once, see ``benchmarks/sweep.py``;
        but for each value that is a dictionary, refers to another or may be new, since Hydra may refuse it.
        """
        options, values = split_overrides(overrides, self.list_options)
        kind = *options, *(text if text[0] == "+" or "{" in text else text.partition("=")[0] for text in values)
        if kind not in self.templates:
            composed = self.context.config_loader.load_sweep_config(self.config, list(overrides))
            if is_robot := composed.machine.get("kind") == "robot":
                with suppress(BadInput, OmegaConfBaseException):  # which the job reports
                    warn_of_models([read_machine(composed)])
            packed, record = pickle.dumps(composed), composed.record
            self.templates[kind] = packed, not (is_robot or record.trace or record.weights)
        return self.templates[kind], values

    def run(self) -> str:
        """Run all jobs, and print and write their table.

        Returns how the sweep ended, see :meth:`_finish`; ``failed`` if it could not
        go on. Raises BadInput if the folder cannot be used, and KeyboardInterrupt after an interrupt.
        """
        with collection(self.folder, SWEEP_KEY):
            self.earlier = list_whole(self.folder) if self.config.sweep.resume else []
            try:
                with self._start() as self.parallel_map:
                    self._run_jobs()
            except (KeyboardInterrupt, Exception) as error:
                is_wrong = isinstance(error, (CmacexpError, *COMPOSITION_ERRORS))
                if is_interrupt(error):
                    self._finish()
                if is_wrong or is_interrupt(error):
                    raise
                print_line(f"error: the sweep ended early: {str(error).strip() or type(error).__name__}", error=True)
                self._finish()
                return Status.FAILED
            return self._finish()

    def _finish(self) -> str:
        """Write the tables of the sweep, print that of its jobs, and list the failures with their causes.

        Returns how it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.
        """
        with show_activity("reading the results of the jobs"):
            runs = collect_jobs(self._list_jobs(), self.planned)
        if not runs:
            print_line(f"continue:  {describe_resume(self.folder)}")
            return Status.FAILED
        failed, missing = [run for run in runs if not run.outcome.is_result], len(self.planned) - len(runs)
        is_wrong = all(run.read("bad_input") for run in runs)
        status = Status.BAD_INPUT if is_wrong else Status.FAILED if missing or failed else Status.COMPLETED
        earlier = manifests.read_sweep(self.folder)
        if missing and earlier and earlier["files"] and earlier["status"] != Status.INTERRUPTED:
            text = "keeps the tables of its earlier sweep; those of this one follow when all its jobs have ended"
            print_line(f"warning: {self.folder} {text}", error=True)
        else:
            write_tables(self.folder, runs, Status.INTERRUPTED if missing else status, self.name)
        keys = dict.fromkeys(key for run in runs for key in run.settings)
        swept = [key for key in keys if len({str(run.settings.get(key)) for run in runs}) > 1]
        print_runs(runs, swept, self.folder / TABLE_CSV)
        counts = Counter(run.outcome.status for run in runs) + Counter({Status.UNFINISHED: missing})
        ends = ", ".join(f"{count} {end}" for end, count in counts.items())
        print_line(f"{counts.total()} job{'s' * (counts.total() > 1)}: {ends}")
        results = [run for run in runs if run.outcome.is_result]
        settings = collect_settings(run.settings for run in results)
        for text in join_idle(settings, [run.idle for run in results]):
            print_line(f"warning: {text}", error=True)
        for run in failed[:MAX_LISTED_FAILURES]:
            print_line(f"  {run.folder.name} {run.outcome.status}: {run.outcome.cause}", error=True)
        if len(failed) > MAX_LISTED_FAILURES:
            print_line(f"  and {len(failed) - MAX_LISTED_FAILURES} more: see {TABLE_CSV}", error=True)
        if self.optimize and self.direction:
            print_line(f"best:      {describe_best(self.optimize, self.direction, runs, swept)}")
        if results:
            print_next(self.folder, {"report": "report"})
        if missing or counts[Status.INTERRUPTED]:
            print_line(f"continue:  {describe_resume(self.folder)}")
        print_line(str(self.folder / TABLE))
        return status

    def _list_jobs(self) -> list[JobRun]:
        """List the jobs that this sweep has run, and, if it is resumed, those that earlier ones have left."""
        return list_jobs(self.folder, [*manifests.list_job_parts(self.folder, self.name), *self.earlier])

    def _start(self) -> AbstractContextManager[ParallelMap]:
        """Start what the launcher stands for."""
        launcher, size = _read_choice(self.config, "launcher"), self.config.sweep.chunk or 1
        if launcher == CORES:
            processes = self.config.hydra.launcher.processes
            self.size = choose_size(max(map(len, self.batches), default=1), count_processes(processes))
            return start_workers(processes)
        if launcher == BASIC:
            return nullcontext(iterate_here)
        from cmacexp.engine.cluster import make_map

        self.size = min(size, MOST_RUNS)
        return nullcontext(make_map(self.config.copy(), self.context, lambda jobs: -(-jobs // size)))

    def _run_jobs(self) -> None:
        if self.batches:
            with write_atomically(self.folder / SETTINGS) as path:
                OmegaConf.save(self.config, path)
            for first, batch in zip(accumulate(map(len, self.batches), initial=0), self.batches, strict=False):
                self.launch(batch, first)
            return
        self.config.hydra.launcher = {"_target_": "hydra_plugins.cmacexp_launcher.CoresLauncher"}
        sweeper = Plugins.instance().instantiate_sweeper(
            config=self.config,
            hydra_context=self.context,
            task_function=self,  # type: ignore[arg-type]  # for its launcher
        )
        sweeper.sweep(_read_typed(self.config.hydra.overrides.task))

    def launch(self, batch: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
        """Run the jobs of a batch, whose first has the number ``first``; what they return, in their order."""
        if not self.batches:
            self._plan(batch)
        known, alike = {}, defaultdict[tuple[bytes, bool], list[JobItem]](list)
        if self.config.sweep.resume:
            known = {(run.read("run"), run.read("overrides")): run for run in self._list_jobs()}
        for number, overrides in enumerate(batch, first):
            template, values = self._pack(overrides)
            run = known.get((number, " ".join(self.planned[number])))
            hashes = tuple(map(run.read, HASHES)) if run is not None and run.outcome.is_result else ()
            alike[template].append(JobItem(list(overrides), values, number, self.places[number], hashes))
        items = [
            (packed, self.folder.absolute(), self.name, own[start : start + size], len(self.planned))
            for (packed, together), own in alike.items()
            for size in [self.size if together else 1]
            for start in range(0, len(own), size)
        ]
        items.sort(key=lambda item: item[3][0].number)
        for text, is_error in chain.from_iterable(self.parallel_map("sweep", _run_jobs, items, len(batch))):
            print_line(text, error=is_error)
        ended = [JobReturn(status=JobStatus.COMPLETED) for _ in batch]
        if self.optimize and not self.batches:  # else no sweeper waits for it
            by_number = {run.read("run"): run for run in self._list_jobs()}
            for number, returned in enumerate(ended, first):
                returned.return_value = read_objective(self.optimize, by_number[number], self.direction)
        return ended


def _run_jobs(packed: bytes, root: Path, sweep: str, items: Sequence[JobItem], jobs: int) -> list[tuple[str, bool]]:
    from cmacexp.engine.job import run_jobs  # here, because the process of the sweep needs nothing of that

    return run_jobs(packed, root, sweep, items, jobs)


def _check_options(config: DictConfig) -> None:
    for key in COUNTS:
        value = OmegaConf.select(config, key)
        require(value is None or (type(value) is int and value > 0), key, value, "must be at least 1, or null")
    for key in ONLY_OF_RUNS:
        value = OmegaConf.select(config.hydra, key)
        require(not value, f"hydra.{key}", value, "must be left out: jobs of a sweep share processes")
    typed = _read_typed(config.hydra.overrides.hydra)
    warn_of_other_mode(typed, "hydra.run", "the folder of a sweep is hydra.sweep.dir")
    require(
        config.sweep.resume is not True or SWEEP_KEY in _list_keys(typed),
        "sweep.resume",
        True,
        "needs the folder of the sweep to resume: add hydra.sweep.dir=DIR",
    )
    require(
        not config.sweep.chunk or _read_choice(config, "launcher") != CORES,
        "sweep.chunk",
        config.sweep.chunk,
        "is for a launcher that starts a process for each job; use hydra/launcher=submitit_slurm, or null",
    )


def _read_objective(config: DictConfig) -> tuple[str | None, str | None]:
    """The metric that ``optimize`` names, and what is done with it, which a sweeper that searches is set to.

    Raises BadInput, see :func:`cmacexp.engine.objective.find_direction`.
    """
    name, searches = config.optimize, "direction" in config.hydra.sweeper
    check_metric(name if name is None else str(name), "robot")  # which has all; a job knows its own machine
    given = OmegaConf.select(config, DIRECTION)
    typed = None if isinstance(given, Enum) else given  # the default of the sweeper is a member of its own Enum
    direction = find_direction(name, typed, searches)
    if searches and typed is None:
        config.hydra.sweeper.direction = direction
        config.hydra.overrides.hydra.append(f"{DIRECTION}={direction}")  # the record of jobs has it there
    return name, direction


def _read_choice(config: DictConfig, group: str) -> str:
    """The option of a group of Hydra's own."""
    return str(config.hydra.runtime.choices[f"hydra/{group}"])


def _read_typed(overrides: Any) -> list[str]:
    """Overrides of a sweep as typed: an interpolation in them is one of each job, not of the sweep."""
    typed: Any = OmegaConf.to_container(overrides, resolve=False)
    return list(typed)


def _list_keys(overrides: Sequence[str]) -> set[str]:
    return {text.partition("=")[0].lstrip("+") for text in overrides}


def collect_jobs(jobs: Sequence[JobRun], planned: Sequence[tuple[str, ...]]) -> list[JobRun]:
    """Select the jobs of a sweep that ended, with the values of their overrides as settings.

    A job that was killed has left nothing. What an earlier sweep left there does not count: it was not ``planned``,
    as overrides of the run of each job.
    """
    texts = dict(enumerate(map(" ".join, planned)))
    runs = [run for run in jobs if texts.get(run.read("run")) == run.read("overrides")]
    for run in runs:
        run.settings = read_settings(planned[run.read("run")])
    return runs


def write_tables(folder: Path, runs: Sequence[JobRun], status: str, sweep: str) -> None:
    """Write the tables of the ``sweep`` of this name, and the manifest with its ``status``; raises OSError.

    Until the manifest lists the new tables, the parts of the sweep have all that they will.
    """
    jobs, metrics = runs[0].tables
    jobs = select_rows(jobs, np.array([run.index for run in runs]))
    metrics = select_rows(metrics, np.isin(as_array(metrics, "run"), as_array(jobs, "run")))
    if replaces := manifests.has_tables(folder):
        write_part(folder, sweep, JobTables(jobs, metrics))  # what a resumed sweep has of the earlier tables
    settings = collect_settings(run.settings for run in runs)
    for place, (name, column) in enumerate(tabulate_settings(settings).items(), 3):
        jobs = jobs.add_column(place, name, column)
    swept = jobs.drop_columns([*HASHES, "idle", "bad_input", FINGERPRINT, "manifest"]).combine_chunks()
    is_lean = "" in jobs[FINGERPRINT].to_pylist()
    tables = {TABLE: swept, manifests.RUNS_FILE: jobs, METRICS_FILE: metrics}
    with full_disk_named(folder):
        if replaces:
            manifests.write(folder, make_sweep_manifest(Status.UNFINISHED))
        for name, table in tables.items():
            with write_atomically(folder / name) as path:
                write_table(table, path)
        with write_atomically(folder / TABLE_CSV) as path:
            pa_csv.write_csv(swept, path)
        files = {name: sha256(folder / name) for name in tables}
        manifests.write(folder, make_sweep_manifest(status, files, is_lean))
    for part in manifests.list_job_parts(folder):
        part.unlink(missing_ok=True)
    with suppress(OSError):  # others have put something into it
        (folder / manifests.JOBS_FOLDER).rmdir()
