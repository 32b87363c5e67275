"""Work in the tasks of a launcher of Hydra, as on a cluster: each task starts a process and does many items."""

import os
import pickle
import shutil
from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from hydra.types import HydraContext
from omegaconf import DictConfig

from cmacexp.config import config_folder
from cmacexp.config.explain import explain_composition
from cmacexp.engine.launch import make_items, make_return, run_packed
from cmacexp.engine.pool import VARIABLE, RunAll, work_on
from cmacexp.errors import BadInput, CmacexpError

FOLDER = ".cmacexp-tasks"
"""In the folder of all results, what each task has to do: launchers send each of them all that a launcher holds."""


class _Task:
    """What a launcher calls in a process of its own."""

    def __init__(self, folder: Path):
        self.folder = folder

    def __call__(self, composed: DictConfig) -> list[Any]:
        work, items = pickle.loads((self.folder / str(HydraConfig.get().job.num)).read_bytes())
        return [work(*item) for item in items]


def run_tasks(
    launcher: Any, context: HydraContext, config: DictConfig, parts: Sequence[tuple[Sequence[str], Any]], first: int
) -> list[Any]:
    """Do parts of some work in a task of a launcher each; for each part what its calls returned.

    A part is overrides that Hydra can compose, whose config is not used, a function, and the arguments of each of its
    calls. The first task has the number ``first``.
    """
    folder = Path(config.hydra.sweep.dir).absolute() / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    try:
        for number, (_, work) in enumerate(parts, first):
            (folder / str(number)).write_bytes(pickle.dumps(work))
        launcher.setup(hydra_context=context, task_function=_Task(folder), config=config)
        return [each.return_value for each in launcher.launch([list(overrides) for overrides, _ in parts], first)]
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class Chunked:
    """A launcher of the jobs of a sweep by another one, ``size`` of a kind in each of its tasks."""

    def __init__(self, launcher: Any, size: int):
        self.launcher, self.size = launcher, size

    def launch(self, batch: Sequence[Sequence[str]], initial_job_idx: int) -> list[JobReturn]:
        """Run the next jobs of the sweep; what they return, in their order."""
        first = initial_job_idx
        items = make_items(self.launcher, batch, first)
        kinds = defaultdict(list)
        for number, item in enumerate(items, first):
            kinds[item[0]].append((number, item))
        chunks = [own[i : i + self.size] for own in kinds.values() for i in range(0, len(own), self.size)]
        parts = [(batch[chunk[0][0] - first], (run_packed, [item for _, item in chunk])) for chunk in chunks]
        inner = self.launcher
        ended = run_tasks(inner, inner.hydra_context, inner.config, parts, first)
        numbers = [number for chunk in chunks for number, _ in chunk]
        by_number = dict(zip(numbers, chain.from_iterable(ended), strict=True))
        return [make_return(*by_number[number]) for number in sorted(numbers)]


def start_tasks(name: str, settings: Sequence[str], count: int, folder: Path) -> RunAll:
    """So many tasks of a launcher of Hydra, for work that is no sweep; gives ``run_all(work, items)``.

    Settings are as ``timeout_min=600``; ``folder`` holds files of both. Raises CmacexpError if there is no such
    launcher.
    """
    if name == "cores":
        raise BadInput("--launcher", name, "is for sweeps; without --launcher a study uses all cores")
    chosen = [f"hydra/launcher={name}", f"hydra.sweep.dir={folder}", "hydra.sweep.subdir=."]
    chosen += [f"hydra.launcher.{setting}" for setting in settings]
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        try:
            config = compose("config", chosen, return_hydra_config=True)
        except HydraException as error:
            raise CmacexpError(explain_composition(error, chosen)) from error
        context = HydraContext(GlobalHydra.instance().config_loader(), Callback())  # type: ignore[arg-type]
        launcher = Plugins.instance().instantiate_launcher(
            hydra_context=context, task_function=_Task(folder), config=config
        )

    def run_all(work: Callable[..., Any], items: Sequence[tuple[Any, ...]], first: int = 0) -> list[Any]:
        shares = [range(i, len(items), count) for i in range(min(count, len(items)))]
        shared = os.environ[VARIABLE]
        parts: list[tuple[list[str], Any]] = [
            ([], (work_on, [(shared, first + i, work, items[i]) for i in share])) for share in shares
        ]
        ended = run_tasks(launcher, context, config, parts, 0)
        by_number = dict(zip(chain.from_iterable(shares), chain.from_iterable(ended), strict=True))
        return [by_number[i] for i in range(len(items))]

    return run_all
