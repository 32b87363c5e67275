"""Searches of ``python -m cmacexp -m`` by Optuna, as a plugin of Hydra."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.plugins.sweeper import Sweeper
from omegaconf import MISSING, DictConfig

SAMPLERS = ("tpe", "random", "gp", "cmaes", "qmc")
"""Samplers of Optuna, as ``hydra/sweeper/sampler=NAME``."""


@dataclass
class SamplerConfig:
    """How Optuna chooses the next trial."""

    name: str = "tpe"
    seed: int | None = None


@dataclass
class OptunaConfig:
    """``hydra/sweeper=optuna``."""

    defaults: list[Any] = field(default_factory=lambda: [{"sampler": "tpe"}])
    _target_: str = f"{__name__}.OptunaSweeper"
    n_trials: int = 20
    """Jobs of the search."""
    n_jobs: int = 2
    """Jobs that run at a time, after which the search learns from all of them."""
    direction: str | None = None
    """minimize or maximize; null: as the metric of ``optimize`` is better."""
    sampler: SamplerConfig = MISSING
    storage: str | None = None
    """URL of a database, such as sqlite:///search.db, with which a killed search is resumed; null: in memory."""
    study_name: str | None = None
    """Name in the storage; null: the folder of the sweep."""
    params: dict[str, Any] = field(default_factory=dict)
    """Intervals and lists of values by key, beside those typed as overrides."""


STORE = ConfigStore.instance()
STORE.store(group="hydra/sweeper", name="optuna", node=OptunaConfig, provider="cmacexp")
for name in SAMPLERS:
    STORE.store(group="hydra/sweeper/sampler", name=name, node=SamplerConfig(name), provider="cmacexp")


class OptunaSweeper(Sweeper):
    """Hands the search to the sweep that has started it."""

    def __init__(self, **options: Any):
        """Keep the options."""
        self.options = options

    def setup(self, *, hydra_context: Any, task_function: Any, config: DictConfig) -> None:
        """Note the sweep."""
        self.sweeping = task_function

    def sweep(self, arguments: list[str]) -> None:
        """Search."""
        from cmacexp.engine.search import search

        search(self.sweeping, arguments, self.options)

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        """Leave that to the sweep, which composes each job."""
