"""What ``hydra/launcher`` stands for: the executor of a sweep or a study, and how much a call of it does."""

import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf

from cmacexp.config import config_folder
from cmacexp.config.explain import explain_composition
from cmacexp.engine.driver import Item, map_runs
from cmacexp.engine.workers import MOST_RUNS, Here, choose_size, count_processes, start_workers
from cmacexp.errors import BadInput, CmacexpError, format_install_command, require
from cmacexp.terminal.output import show_activity

BASIC, CORES, DASK, SUBMITIT = "basic", "cores", "dask", "submitit_"
"""Launchers: this process, processes here, Dask, and the beginning of those of submitit."""
MOST_TASKS = 900
"""Tasks of a cluster, at most: SLURM takes up to 1,000 in an array unless its administrator allows more."""
TASK_SECONDS = 60.0
"""Estimated work of a task, s: to start one takes some seconds."""
DASK_WORKERS = 16
"""Workers of Dask for the number of runs that one takes at a time: more may join."""


@dataclass
class Work:
    """A function, and the items that a launcher maps over it."""

    function: Callable[..., Any]
    items: Sequence[Item]
    what: str = "running"
    """Its name beside the progress."""
    count_runs: Callable[[Item], int] = lambda item: 1
    """Gives the number of runs in an item."""
    on_lost: Callable[[str], None] | None = None
    """Takes why a task was lost; None: that ends the work."""
    seconds: float = TASK_SECONDS
    """That all items take on one core, about."""

    @property
    def runs(self) -> int:
        """Number of runs in all items."""
        return sum(map(self.count_runs, self.items))


class Launcher:
    """Maps items over a function on an executor.

    Args:
        executor: where the function is called.
        choose_size: gives the number of jobs without folders that a worker takes at a time, of a number of jobs.
    """

    def __init__(self, executor: Executor, choose_size: Callable[[int], int]):
        self.executor = executor
        self.choose_size = choose_size

    def map(self, work: Work) -> Iterator[tuple[int, Any]]:
        """Yield the index of each item and its result, as soon as it has ended."""
        yield from map_runs(
            work.function, work.items, self.executor, work.what, work.runs, work.count_runs, work.on_lost
        )

    def map_in_order(self, what: str, function: Callable[..., Any], items: Sequence[Item]) -> list[Any]:
        """Call a function with each item; returns the results in the order of the items."""
        results = dict(self.map(Work(function, items, what)))
        return [results[index] for index in range(len(items))]


class TaskLauncher(Launcher):
    """Maps items in tasks of a cluster, each of which does a share of them on all its cores.

    Args:
        executor: that submits tasks.
        tasks: how many; None: as many as the work repays, at least one.
        chunk: runs in a task, if ``tasks`` is None; None: as many as repay starting it.
    """

    def __init__(self, executor: Executor, tasks: int | None = None, chunk: int | None = None):
        super().__init__(executor, lambda jobs: min(chunk or MOST_RUNS, MOST_RUNS))
        self.tasks = tasks
        self.chunk = chunk

    def split(self, work: Work) -> list[Sequence[Item]]:
        """Split items into the shares of tasks; raises BadInput if a chunk makes too many."""
        tasks = self.tasks or min(MOST_TASKS, round(work.seconds / TASK_SECONDS))
        runs = work.runs
        if self.chunk is not None and self.tasks is None:
            tasks = -(-runs // self.chunk)
            allowed = f"makes {tasks} tasks of {runs} jobs; give at least {-(-runs // MOST_TASKS)}, or null"
            require(tasks <= MOST_TASKS, "sweep.chunk", self.chunk, allowed)
        tasks = min(max(1, tasks), len(work.items))
        return [work.items[first::tasks] for first in range(tasks)]

    def map(self, work: Work) -> Iterator[tuple[int, Any]]:
        """Yield the results of all items of a task when it has ended."""
        from cmacexp.engine.slurm import do_share

        shares = self.split(work)
        results_by_share = map_runs(
            do_share,
            [(work.function, share) for share in shares],
            self.executor,
            work.what,
            work.runs,
            lambda share: sum(map(work.count_runs, share[1])),
            work.on_lost,
            ahead=len(shares) + 1,
        )
        for first, results in results_by_share:
            yield from ((first + len(shares) * index, result) for index, result in results.items())


def _do_share(function: Callable[..., Any], shares: Sequence[Sequence[Item]], _: DictConfig) -> list[Any]:
    """Do the share of the items with the number of the job that a launcher of Hydra runs in this process."""
    return [function(*item) for item in shares[HydraConfig.get().job.num]]


class PluginLauncher(TaskLauncher):
    """Maps items in jobs of another launcher of Hydra, such as joblib; their results come when all have ended."""

    def __init__(self, config: DictConfig, context: HydraContext, tasks: int | None, chunk: int | None):
        super().__init__(Here(), tasks, chunk)
        self.config = config
        self.context = context
        config.hydra.overrides.hydra.append("hydra.sweep.subdir=.")  # the folder that it makes for a task

    def map(self, work: Work) -> Iterator[tuple[int, Any]]:
        """Yield the results of all items."""
        shares = self.split(work)
        launcher = Plugins.instance().instantiate_launcher(
            hydra_context=self.context, task_function=partial(_do_share, work.function, shares), config=self.config
        )
        with show_activity(f"{work.what}: {work.runs} in {len(shares)} tasks of the launcher"):
            results_by_share = [job.return_value for job in launcher.launch([[] for _ in shares], 0)]
        for first, results in enumerate(results_by_share):
            yield from ((first + len(shares) * index, result) for index, result in enumerate(results))


@contextmanager
def _start_dask(address: str | None, processes: int | None) -> Iterator[Launcher]:
    """Start a cluster of Dask on this machine, or use the one of a scheduler; raises BadInput without it."""
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise BadInput(
            "hydra/launcher", DASK, f"needs distributed: {format_install_command('distributed')}"
        ) from None
    size = count_processes(processes)
    try:
        cluster = address or LocalCluster(n_workers=size, threads_per_worker=1, dashboard_address="127.0.0.1:0")
        client = Client(cluster, timeout="10s")
    except (OSError, ValueError) as error:
        raise BadInput("hydra.launcher.address", address, f"no scheduler of Dask answers there ({error})") from None
    with client, client.get_executor() as executor:
        workers = DASK_WORKERS if address else size
        try:
            yield Launcher(executor, lambda jobs: choose_size(jobs, workers))
        finally:
            if not isinstance(cluster, str):
                cluster.close()


@contextmanager
def start_launcher(
    name: str, options: DictConfig, config: DictConfig, context: HydraContext, tasks: int | None = None
) -> Iterator[Launcher]:
    """Start what a launcher of Hydra stands for, by its name, the options in its config, and the config of Hydra.

    ``tasks`` is the number of tasks on a cluster; None: it follows from the work. Raises CmacexpError.
    """
    chunk: int | None = config.sweep.chunk
    if name == BASIC:
        yield Launcher(Here(), lambda jobs: 1)
    elif name == CORES:
        size = count_processes(options.processes)
        with start_workers(size) as executor:
            yield Launcher(executor, lambda jobs: choose_size(jobs, size))
    elif name == DASK:
        with _start_dask(options.address, options.processes) as launcher:
            yield launcher
    elif name.startswith(SUBMITIT):
        with _start_tasks(name.removeprefix(SUBMITIT), options) as executor:
            yield TaskLauncher(executor, tasks, chunk)
    else:
        yield PluginLauncher(config, context, tasks, chunk)


def find_choice(composed: DictConfig, group: str) -> str | None:
    """Find the option of a group of Hydra that a user's file for a chosen option overrides; None: there is none.

    Hydra composes its own groups first and ignores that override.
    """
    runtime = composed.hydra.runtime
    names = [f"{chosen_group.partition('@')[0]}/{option}.yaml" for chosen_group, option in runtime.choices.items()]
    folders = [Path(source.path) for source in runtime.config_sources if source.schema == "file"]
    files = [folder / name for name in names for folder in folders if folder != config_folder()]
    contents = [yaml.safe_load(file.read_text(encoding="utf-8")) or {} for file in files if file.is_file()]
    entries = [entry for content in contents for entry in content.get("defaults") or () if isinstance(entry, dict)]
    overrides = [item for entry in entries for item in entry.items()]
    return next((str(name) for key, name in overrides if re.fullmatch(f"override +/?{group}", str(key))), None)


def _start_tasks(cluster: str, options: DictConfig) -> Any:
    """Make the executor of submitit from the config of its launcher, as the launcher does."""
    from hydra_plugins.hydra_submitit_launcher.config import BaseQueueConf

    from cmacexp.engine.slurm import Tasks

    plain: Any = OmegaConf.to_container(options, resolve=True)
    folder = plain.pop("submitit_folder")
    shared = {*OmegaConf.structured(BaseQueueConf)}
    plain.pop("_target_")
    return Tasks(cluster, folder, {key if key in shared else f"{cluster}_{key}": plain[key] for key in plain})


@contextmanager
def start_study_launcher(name: str, settings: Sequence[str], tasks: int, folder: Path) -> Iterator[Launcher]:
    """Start a number of tasks of a launcher for the runs of a study; ``folder`` holds its own files.

    Settings are as ``timeout_min=600``. Raises CmacexpError if there is no such launcher.
    """
    require(name != CORES, "--launcher", name, "is for sweeps; without --launcher a study uses all cores")
    chosen = [
        f"hydra/launcher={name}",
        f"hydra.sweep.dir={folder}",
        *(f"hydra.launcher.{setting}" for setting in settings),
    ]
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        try:
            config = compose("config", [*chosen, "hydra.job.name=study"], return_hydra_config=True)
        except HydraException as error:
            raise CmacexpError(explain_composition(error, chosen)) from error
        context = HydraContext(GlobalHydra.instance().config_loader(), Callback())  # type: ignore[arg-type]
        with start_launcher(name, config.hydra.launcher, config, context, tasks) as launcher:
            yield launcher
