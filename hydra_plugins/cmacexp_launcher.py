"""The launcher that ``python -m cmacexp -m`` uses by default, as a plugin of Hydra: the processes of the sweep."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.utils import JobReturn
from hydra.plugins.launcher import Launcher

NAME = "cores"


@dataclass
class CoresConfig:
    """``hydra/launcher=cores``."""

    _target_: str = f"{__name__}.CoresLauncher"
    processes: int | None = None
    """That run jobs; null: one for each core that this process may use."""


@dataclass
class DaskConfig:
    """``hydra/launcher=dask``."""

    _target_: str = f"{__name__}.CoresLauncher"
    address: str | None = None
    """Of a scheduler, such as tcp://127.0.0.1:8786; null: workers on this machine."""
    processes: int | None = None
    """Workers on this machine; null: one for each core that this process may use."""


ConfigStore.instance().store(group="hydra/launcher", name=NAME, node=CoresConfig, provider="cmacexp")
ConfigStore.instance().store(group="hydra/launcher", name="dask", node=DaskConfig, provider="cmacexp")


class CoresLauncher(Launcher):
    """Hands the jobs of a sweeper to :class:`cmacexp.engine.sweep.Sweep`, which has started the sweeper."""

    def __init__(self, processes: int | None = None):
        """Ignore the options, which the sweep itself reads."""

    def setup(self, *, task_function: Any, **kwargs: Any) -> None:
        """Note the sweep."""
        self.sweep = task_function

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> list[JobReturn]:
        """Run the next jobs of the sweep; what they return, in their order."""
        from cmacexp.engine.sweep import Sweep

        if not isinstance(self.sweep, Sweep):
            raise RuntimeError("hydra/launcher=cores is for python -m cmacexp -m; choose hydra/launcher=basic")
        return self.sweep.launch(job_overrides, initial_job_idx)
