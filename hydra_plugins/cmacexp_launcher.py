"""The launcher that ``python -m cmacexp -m`` uses by default, as a plugin of Hydra: all cores, see its launch."""

from collections.abc import Sequence
from dataclasses import dataclass

from hydra.core.config_store import ConfigStore
from hydra.core.utils import JobReturn
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig

NAME = "cores"


@dataclass
class CoresConfig:
    """``hydra/launcher=cores``."""

    _target_: str = f"{__name__}.CoresLauncher"
    processes: int | None = None
    """That run jobs; null: one for each core that this process may use."""


ConfigStore.instance().store(group="hydra/launcher", name=NAME, node=CoresConfig, provider="cmacexp")


class CoresLauncher(Launcher):
    """Runs jobs in processes that import once and compose each kind of job once."""

    def __init__(self, processes: int | None = None):
        """The sweep itself reads how many processes it may start."""

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Note what the jobs of the sweep have in common."""
        self.hydra_context, self.config = hydra_context, config

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> list[JobReturn]:
        """Run the next jobs of the sweep; what they return, in their order."""
        from cmacexp.engine.launch import launch

        return launch(self, job_overrides, initial_job_idx)
