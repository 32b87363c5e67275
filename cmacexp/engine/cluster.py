"""Work in tasks of a launcher of Hydra, as on a cluster: a task is a job of it, and does many items."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from hydra.types import HydraContext
from omegaconf import DictConfig

from cmacexp.config import config_folder
from cmacexp.config.explain import explain_composition
from cmacexp.engine.pool import ParallelMap
from cmacexp.errors import CmacexpError, require
from cmacexp.terminal.output import show_activity


def _do_share(work: Callable[..., Any], shares: Sequence[Sequence[Sequence[Any]]], _: DictConfig) -> list[Any]:
    """What a launcher calls in a process of its own: does the share of the items that has the number of its job."""
    return [work(*item) for item in shares[HydraConfig.get().job.num]]


def make_map(config: DictConfig, context: HydraContext, count: Callable[[int], int]) -> ParallelMap:
    """A :data:`cmacexp.engine.pool.ParallelMap` by the launcher of a config of Hydra.

    ``count`` gives the number of tasks for so many runs. What Hydra composes for a task is not used.
    """
    config.hydra.overrides.hydra.append("hydra.sweep.subdir=.")  # the folder that it makes for a task

    def map_in_tasks(
        what: str,
        work: Callable[..., Any],
        items: Sequence[Sequence[Any]],
        runs: int | None = None,
    ) -> Iterator[Any]:
        tasks = min(count(runs or len(items)), len(items))
        shares = [items[first::tasks] for first in range(tasks)]
        launcher = Plugins.instance().instantiate_launcher(
            hydra_context=context, task_function=partial(_do_share, work, shares), config=config
        )
        with show_activity(f"{what}: {runs or len(items)} in {tasks} tasks of the launcher"):
            ended = [each.return_value for each in launcher.launch([[] for _ in shares], 0)]
        yield from (ended[i % tasks][i // tasks] for i in range(len(items)))

    return map_in_tasks


def start_tasks(name: str, settings: Sequence[str], tasks: int, folder: Path) -> ParallelMap:
    """So many tasks of a launcher of Hydra, for work that is no sweep; ``folder`` holds its own files.

    Settings are as ``timeout_min=600``. Raises CmacexpError if there is no such launcher.
    """
    require(name != "cores", "--launcher", name, "is for sweeps; without --launcher a study uses all cores")
    chosen = [f"hydra/launcher={name}", f"hydra.sweep.dir={folder}", *(f"hydra.launcher.{each}" for each in settings)]
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        try:
            config = compose("config", chosen, return_hydra_config=True)
        except HydraException as error:
            raise CmacexpError(explain_composition(error, chosen)) from error
        context = HydraContext(GlobalHydra.instance().config_loader(), Callback())  # type: ignore[arg-type]
    return make_map(config, context, lambda runs: tasks)
