"""A sweep: its folder, the kinds of its jobs, and the processes that run them."""

import re
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from cmacexp.errors import BadInput

if TYPE_CHECKING:
    from cmacexp.engine.pool import RunAll

SWEEP_KEY = "hydra.sweep.dir"


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

    ``place`` is its folder once that is made; ``planned`` counts jobs by their overrides, see
    :func:`select_run_overrides`; ``kinds`` are those of :meth:`get_kind`. ``optimize`` is the metric that jobs
    return, ``direction`` whether to ``minimize`` or to ``maximize`` it; None: nobody said.
    """

    current: "Sweep | None" = None
    """The sweep that this process started."""

    def __init__(
        self,
        folder: Path,
        chunk: int | None = None,
        processes: int | None = None,
        objective: tuple[str | None, str | None] = (None, None),
    ):
        self.folder, self.chunk, self.processes = folder, chunk, processes
        self.optimize, self.direction = objective
        self.place: Path | None = None
        self.planned: Counter[tuple[str, ...]] = Counter()
        self.kinds: dict[tuple[str, ...], Kind] = {}
        self.run_all: RunAll | None = None
        self.lock, self.progress = ExitStack(), ExitStack()
        """Left when the sweep is over, and when its jobs are."""

    def begin(self) -> None:
        """Make the folder, and show how many jobs are done; raises BadInput, OSError."""
        from cmacexp.data.folder import collection  # here, because every command imports this file
        from cmacexp.engine.pool import shared_progress

        self.place = self.lock.enter_context(collection(self.folder, SWEEP_KEY))
        self.progress.enter_context(shared_progress("sweep", self.planned.total, "jobs"))

    def start_workers(self) -> "RunAll":
        """Start the processes that run jobs, as many as there are cores unless so many are asked for; once."""
        from cmacexp.engine.pool import start_pool

        if self.run_all is None:
            self.run_all = self.progress.enter_context(start_pool(self.processes))
        return self.run_all

    def get_kind(self, caller: Any, overrides: Sequence[str]) -> Kind:
        """The kind of a job: whether it can be composed depends on its keys and on the options that it chooses.

        Jobs that differ in values alone, which can be thousands, are of one kind, composed once. See
        ``benchmarks/sweep.py``. Raises HydraException if it cannot be composed.
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
        """Note the next jobs, before they start, and compose one of each kind; raises HydraException."""
        for overrides in batch:
            self.planned[tuple(select_run_overrides(overrides))] += 1
            kind = self.get_kind(sweeper, overrides)
            kind.runs.append(select_run_overrides(overrides))
            if len(kind.runs) == 1 and kind.composed.machine.get("kind") == "robot":
                from cmacexp.config.robot_rule import read_machine
                from cmacexp.terminal.messages import warn_of_models

                with suppress(BadInput, OmegaConfBaseException):  # which the job reports
                    warn_of_models([read_machine(kind.composed)])


@cache
def _is_group(loader: Any, key: str) -> bool:
    return bool(loader.get_group_options(key))


def get_sweep() -> Sweep:
    """The sweep that this process started."""
    if Sweep.current is None:
        raise RuntimeError("hydra/launcher=cores is for python -m cmacexp -m; choose hydra/launcher=basic")
    return Sweep.current


def select_run_overrides(overrides: Sequence[str]) -> list[str]:
    """The overrides of the run, without those of the sweep."""
    return [text for text in overrides if re.split(r"[=./]", text)[0] not in ("sweep", "optimize", "hydra")]
