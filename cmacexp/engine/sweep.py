"""A sweep: its options are checked, its jobs are composed before anything runs, and then run as its launcher says.

At its end its table, one row per job, is written and printed.
"""

import pickle
from collections import defaultdict
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from enum import Enum
from functools import cache
from itertools import accumulate
from pathlib import Path
from secrets import token_hex
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config.compose import expand_grid, split_overrides
from cmacexp.config.explain import COMPOSITION_ERRORS, explain_composition
from cmacexp.config.robot_rule import read_machine
from cmacexp.data import manifest as manifests
from cmacexp.data.files import write_atomically
from cmacexp.data.folder import SETTINGS, TABLE, collection, make_sweep_manifest
from cmacexp.engine.job_store import HASHES, JobItem, iterate_jobs, list_jobs, list_whole
from cmacexp.engine.launcher import CORES, Launcher, Work, find_choice, start_launcher
from cmacexp.engine.objective import DIRECTION, check_metric, find_direction, read_objective
from cmacexp.engine.sweep_end import SweepEnd
from cmacexp.engine.sweep_tables import select_run_overrides
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.terminal.messages import describe_resume, warn_of_models, warn_of_other_mode
from cmacexp.terminal.output import print_line, show_activity
from cmacexp.typing import RESULTS, Status

SWEEP_KEY, SUBDIR = "hydra.sweep.dir", "${hydra.job.num}"
GRID = "basic"
"""Hydra's own sweeper, whose jobs are known before the first one runs."""
COUNTS = ("sweep.chunk", "hydra.launcher.processes", "hydra.sweeper.max_batch_size")
"""Options of a sweep that are numbers, at least 1, or null."""
ONLY_OF_RUNS = ("callbacks", "job.chdir", "job.env_set", "output_subdir", "job_logging.root")
"""What Hydra does around a single run; so many jobs share a process."""
CHUNK_SECONDS = 1.0
"""Estimated work that a worker takes at a time, s: it ends early only between two such pieces."""
DEFAULT = "record=trace"
"""Override of a sweep that does not set ``record``."""
STEP_SECONDS, RUN_SECONDS = {"leg": 1e-6, "quadruped": 6e-6, "robot": 30e-6}, 0.02
"""Estimated seconds of a step, by the kind of machine, and of a run besides, for the number of tasks on a cluster."""


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
        self.config = config
        self.context = context
        self.folder = Path(config.hydra.sweep.dir)
        self.name = token_hex(4)
        """What the parts of its tables are called by."""
        self.earlier: list[Path] = []
        """What earlier sweeps have left that this one resumes."""
        self.planned: list[tuple[str, ...]] = []
        """Overrides of the run of each job, see :func:`select_run_overrides`."""
        self.places: list[str] = []
        """Folders of these jobs, in that of the sweep."""
        self.templates: dict[tuple[str, ...], tuple[bytes, bool, float]] = {}
        """Arguments ``packed`` of :func:`cmacexp.engine.job.run_jobs`, by what jobs have in common; whether a process
        takes several of these jobs at a time: those that keep metrics only, and are no robot's; and the estimated
        duration of one, s."""
        self.list_options = cache(context.config_loader.get_group_options)
        """Lists the options of a key; a field has none. Hydra takes longer to list them than to run a job."""
        self.launcher: Launcher
        self.optimize, self.direction = _read_objective(config)
        _check_options(config)
        self.hydra_groups = {group: _read_plain(config.hydra[group]) for group in ("launcher", "sweeper")}
        """Configs of Hydra's own that all jobs share."""
        self.batches: list[list[list[str]]] = self._expand()
        """Overrides of the jobs, if they are known before the first of them runs."""
        for batch in self.batches:
            self._plan(batch)

    def _expand(self) -> Any:
        """List the batches of jobs of the grid sweeper; raises BadInput if a key is swept over no value."""
        sweeper = self.config.hydra.sweeper
        task_overrides = _read_plain(self.config.hydra.overrides.task)
        searched = [f"{key}={value}" for key, value in (sweeper.get("params") or {}).items()]
        if "record" not in _list_keys([*searched, *task_overrides]):
            self.config.hydra.overrides.task.append(DEFAULT)
            task_overrides.append(DEFAULT)
        parser = OverridesParser.create(config_loader=self.context.config_loader)
        overrides = parser.parse_overrides([*searched, *task_overrides])
        for override in overrides:
            if override.is_discrete_sweep() and next(iter(override.sweep_iterator()), None) is None:
                key, _, value = str(override.input_line).partition("=")
                raise BadInput(key, value, "matches no option; glob is for groups, a field takes values: 8,16")
        return expand_grid(overrides, sweeper.max_batch_size) if _read_choice(self.config, "sweeper") == GRID else []

    def _plan(self, batch: Sequence[Sequence[str]]) -> None:
        """Note jobs, and compose one of each kind; raises BadInput if two have the same folder."""
        typed = _read_plain(self.config.hydra.sweep)
        for overrides in batch:
            number = len(self.planned)
            is_own = typed["subdir"] == SUBDIR
            self.places.append(str(number) if is_own else self._find_place(overrides, number, typed["subdir"]))
            self.planned.append(tuple(select_run_overrides(overrides)))
            self._pack(overrides)

    def _find_place(self, overrides: Sequence[str], number: int, typed: str) -> str:
        """Choose the folder of a job from ``hydra.sweep.subdir``; raises BadInput if an earlier job has it."""
        composed = self._compose(overrides)
        with read_write(composed.hydra), open_dict(composed.hydra):
            composed.hydra.job.num = number
            composed.hydra.job.id = str(number)
        place = str(composed.hydra.sweep.subdir)
        require(
            place not in self.places,
            "hydra.sweep.subdir",
            typed,
            f"must differ for each job, e.g. {SUBDIR}",
        )
        return place

    def _compose(self, overrides: Sequence[str]) -> DictConfig:
        """Compose a job; raises CmacexpError if Hydra cannot, or if the job chooses how the sweep itself runs."""
        try:
            composed = self.context.config_loader.load_sweep_config(self.config, list(overrides))
        except COMPOSITION_ERRORS as error:
            raise CmacexpError(explain_composition(error, overrides)) from error
        for group, node in self.hydra_groups.items():
            chosen = _read_choice(self.config, group)
            hidden = find_choice(composed, f"hydra/{group}")
            is_typed = f"hydra/{group}" in _list_keys(_read_plain(self.config.hydra.overrides.hydra))
            require(
                _read_plain(composed.hydra[group]) == node and (is_typed or hidden in (None, chosen)),
                f"hydra/{group}",
                hidden or composed.hydra[group],
                f"is set in a file of the job {' '.join(overrides)}, but all jobs share one, here {chosen}: "
                f"give it on the command line, hydra/{group}=NAME and hydra.{group}.KEY=VALUE",
            )
        return composed

    def _pack(self, overrides: Sequence[str]) -> tuple[tuple[bytes, bool, float], list[str]]:
        """Compose a job, pickled, and list the overrides that set its values in that.

        Jobs that differ in such values alone, which can be thousands, are composed once, see ``benchmarks/sweep.py``;
        but for each value that is a dictionary, refers to another or may be new, since Hydra may refuse it.
        """
        options, values = split_overrides(overrides, self.list_options)
        kind = *options, *(text if text[0] == "+" or "{" in text else text.partition("=")[0] for text in values)
        if kind not in self.templates:
            composed = self._compose(overrides)
            if is_robot := composed.machine.get("kind") == "robot":
                with suppress(BadInput, OmegaConfBaseException):  # which the job reports
                    warn_of_models([read_machine(composed)])
            packed = pickle.dumps(composed)
            record = composed.record
            is_short = not (is_robot or record.trace or record.weights)
            self.templates[kind] = packed, is_short, _estimate_seconds(composed)
        return self.templates[kind], values

    def run(self) -> str:
        """Run all jobs, and print and write their table.

        Returns how the sweep ended, see :attr:`SweepEnd.status`; ``failed`` if it could not
        go on. Raises BadInput if the folder cannot be used, and KeyboardInterrupt after an interrupt.
        """
        with collection(self.folder, SWEEP_KEY):
            self.earlier = list_whole(self.folder) if self.config.sweep.resume else []
            if not manifests.has_tables(self.folder):
                names = dict.fromkeys([self.name, *(path.name.partition("-")[0] for path in self.earlier)])
                manifests.write(self.folder, make_sweep_manifest(Status.UNFINISHED, sweeps=[*names]))
            try:
                with self._start() as self.launcher:
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
        """Write the tables of the sweep and print how its jobs ended; returns how the sweep did."""
        searched = (self.optimize, self.direction) if self.optimize and self.direction else None
        with show_activity("reading the results of the jobs"):
            end = SweepEnd(self.folder, self._list_sources(), self.planned, searched)
        if not end.counts:
            print_line(f"continue:  {describe_resume(self.folder)}")
            return Status.FAILED
        earlier = manifests.read_sweep(self.folder)
        if end.missing and earlier and earlier["files"] and earlier["status"] != Status.INTERRUPTED:
            text = "keeps the tables of its earlier sweep; those of this one follow when all its jobs have ended"
            print_line(f"warning: {self.folder} {text}", error=True)
        else:
            end.write(Status.INTERRUPTED if end.missing else end.status, self.name)
        end.print()
        print_line(str(self.folder / TABLE))
        return end.status

    def _list_sources(self) -> list[Path]:
        """List the parts that jobs of this sweep have left, and, if it is resumed, what earlier ones have."""
        return [*manifests.list_job_parts(self.folder, self.name), *self.earlier]

    def _start(self) -> AbstractContextManager[Launcher]:
        """Start what the launcher stands for."""
        launcher = _read_choice(self.config, "launcher")
        return start_launcher(launcher, self.config.hydra.launcher, self.config.copy(), self.context)

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
        sweeper.sweep(_read_plain(self.config.hydra.overrides.task))

    def launch(self, batch: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
        """Run the jobs of a batch, whose first has the number ``first``; what they return, in their order."""
        if not self.batches:
            self._plan(batch)
        known_hashes = self._list_known()
        jobs_by_template = defaultdict[tuple[bytes, bool, float], list[JobItem]](list)
        for number, overrides in enumerate(batch, first):
            template, values = self._pack(overrides)
            hashes = known_hashes.get((number, " ".join(self.planned[number])), ())
            jobs_by_template[template].append(JobItem(list(overrides), values, number, self.places[number], hashes))
        size = self.launcher.choose_size(len(batch))
        items = [
            (packed, self.folder.absolute(), self.name, jobs[start : start + chunk], len(self.planned))
            for (packed, is_short, seconds), jobs in jobs_by_template.items()
            for chunk in [max(1, min(size, round(CHUNK_SECONDS / seconds))) if is_short else 1]
            for start in range(0, len(jobs), chunk)
        ]
        items.sort(key=lambda item: item[3][0].number)
        seconds = sum(seconds * len(jobs) for (*_, seconds), jobs in jobs_by_template.items())
        work = Work(_run_jobs, items, "sweep", lambda item: len(item[3]), _report_lost, seconds)
        for _, lines in self.launcher.map(work):
            for text, is_error in lines:
                print_line(text, error=is_error)
        returns = [JobReturn(status=JobStatus.COMPLETED) for _ in batch]
        if self.optimize and not self.batches:  # else no sweeper waits for it
            by_number = {run.read("run"): run for run in list_jobs(self.folder, self._list_sources())}
            for number, returned in enumerate(returns, first):
                if number in by_number:
                    returned.return_value = read_objective(self.optimize, by_number[number], self.direction)
        return returns

    def _list_known(self) -> dict[tuple[int, str], tuple[str, ...]]:
        """List the hashes of the results that a resumed sweep finds, by the number of the job and its overrides."""
        hashes_by_job = dict[tuple[int, str], tuple[str, ...]]()
        for jobs, _ in iterate_jobs(self._list_sources() if self.config.sweep.resume else ()):
            names = ("run", "overrides", "status", *HASHES)
            for number, overrides, status, *hashes in zip(*(jobs[name].to_pylist() for name in names), strict=True):
                if status in RESULTS:
                    hashes_by_job[number, overrides] = tuple(hashes)
        return hashes_by_job


def _estimate_seconds(composed: DictConfig) -> float:
    """Estimate how long a job takes, s; of one that is wrong as of one without steps."""
    with suppress(Exception):  # which the job reports
        steps = composed.cycles * composed.gait.cycle_time / composed.sampling_period
        return RUN_SECONDS + float(steps) * STEP_SECONDS[composed.machine.kind]
    return RUN_SECONDS


def _report_lost(reason: str) -> None:
    """Print why a task was lost; the others go on."""
    print_line(f"error: {reason}", error=True)


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
    hydra_overrides = _read_plain(config.hydra.overrides.hydra)
    warn_of_other_mode(hydra_overrides, "hydra.run", "the folder of a sweep is hydra.sweep.dir")
    require(
        config.sweep.resume is not True or SWEEP_KEY in _list_keys(hydra_overrides),
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
    """Read the metric that ``optimize`` names, and the direction of the search, which the sweeper is set to.

    Raises BadInput, see :func:`cmacexp.engine.objective.find_direction`.
    """
    name = config.optimize
    searches = "direction" in config.hydra.sweeper
    check_metric(name if name is None else str(name), "robot")  # which has all; a job knows its own machine
    given = OmegaConf.select(config, DIRECTION)
    typed = None if isinstance(given, Enum) else given  # the default of the sweeper is a member of its own Enum
    direction = find_direction(name, typed, searches)
    if searches and typed is None:
        config.hydra.sweeper.direction = direction
        config.hydra.overrides.hydra.append(f"{DIRECTION}={direction}")  # the record of jobs has it there
    return name, direction


def _read_choice(config: DictConfig, group: str) -> str:
    """Read the option that is chosen in a group of Hydra's own."""
    return str(config.hydra.runtime.choices[f"hydra/{group}"])


def _read_plain(node: Any) -> Any:
    """Read overrides or another node of a sweep as typed: an interpolation belongs to each job, not to the sweep."""
    return OmegaConf.to_container(node, resolve=False)


def _list_keys(overrides: Sequence[str]) -> set[str]:
    return {text.partition("=")[0].lstrip("+") for text in overrides}
