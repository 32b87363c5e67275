"""The start of a sweep: make its folder, check its options, note its jobs, set ``record=trace`` by default."""

from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from hydra.plugins.sweeper import Sweeper
from omegaconf import DictConfig, OmegaConf

from cmacexp.engine.sweep import Sweep
from cmacexp.errors import BadInput

DEFAULT = "record=trace"
"""Override of a sweep that does not set ``record``."""
CORES = "hydra_plugins.cmacexp_launcher.CoresLauncher"


class SweepRefused(BaseException):
    """A sweep cannot start, for the error that it is made with; Hydra ignores an ``Exception`` of a callback."""


class SweepStart(Callback):
    """Called by Hydra when a sweep starts; see ``hydra.callbacks`` in ``conf/config.yaml``."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Prepare the sweep, before its jobs are made."""
        try:
            _check_values(config)
            sweep = Sweep(Path(config.hydra.sweep.dir), *_read_options(config), _read_objective(config))
            sweep.begin()
        except (BadInput, OSError, HydraException) as error:
            raise SweepRefused(error) from error
        Sweep.current = sweep
        if config.hydra.launcher._target_ == CORES:
            sweep.start_workers()  # while Hydra composes the jobs
        typed = _keys(config.hydra.overrides.task)
        searched = map(str, OmegaConf.select(config, "hydra.sweeper.params") or {})
        if "record" not in {*typed, *searched}:
            config.hydra.overrides.task.append(DEFAULT)

        def check(sweeper: Sweeper, batch: Sequence[Sequence[str]]) -> None:
            sweep.check(sweeper, batch)
            if sweep.chunk:
                from cmacexp.engine.cluster import Chunked

                if not isinstance(sweeper.launcher, Chunked):  # else it is that of the last batch
                    sweeper.launcher = Chunked(sweeper.launcher, sweep.chunk)  # type: ignore[assignment]

        Sweeper.validate_batch_is_legal = check  # type: ignore[method-assign, assignment]  # called by all sweepers


def _read_options(config: DictConfig) -> tuple[int | None, int | None]:
    """Jobs in a task, and processes; raises BadInput."""
    chunk = config.sweep.chunk
    processes = OmegaConf.select(config, "hydra.launcher.processes")
    for key, value in (("sweep.chunk", chunk), ("hydra.launcher.processes", processes)):
        if value is not None and (type(value) is not int or value < 1):
            raise BadInput(key, value, "must be at least 1, or null")
    if config.sweep.resume is True and "hydra.sweep.dir" not in _keys(config.hydra.overrides.hydra):
        raise BadInput("sweep.resume", True, "needs the folder of the sweep to resume: add hydra.sweep.dir=DIR")
    if chunk and config.hydra.launcher._target_ == CORES:
        allowed = "is for a launcher that starts a process for each job; use hydra/launcher=submitit_slurm, or null"
        raise BadInput("sweep.chunk", chunk, allowed)
    return chunk, processes


def _read_objective(config: DictConfig) -> tuple[str | None, str | None]:
    """The metric that ``optimize`` names, and what is done with it, which a sweeper that searches is set to.

    Raises BadInput, see :func:`cmacexp.engine.objective.find_direction`.
    """
    name, searches = config.optimize, "direction" in config.hydra.sweeper
    if name is None and not searches:
        return None, None
    from cmacexp.engine.objective import DIRECTION, check_metric, find_direction

    check_metric(name if name is None else str(name), "robot")  # which has all; a job knows its own machine
    given = OmegaConf.select(config, DIRECTION)
    typed = None if isinstance(given, Enum) else given  # the default of the sweeper is a member of its own Enum
    direction = find_direction(name, typed, searches)
    if searches and typed is None:
        config.hydra.sweeper.direction = direction
        config.hydra.overrides.hydra.append(f"{DIRECTION}={direction}")  # jobs read it there
    return name, direction


def _check_values(config: DictConfig) -> None:
    """Raises BadInput if a key is swept over no value, before jobs are made."""
    searched = [f"{key}={value}" for key, value in (OmegaConf.select(config, "hydra.sweeper.params") or {}).items()]
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    for override in parser.parse_overrides([*searched, *config.hydra.overrides.task]):
        if override.is_discrete_sweep() and next(iter(override.sweep_iterator()), None) is None:
            key, _, value = str(override.input_line).partition("=")
            raise BadInput(key, value, "matches no option; glob is for groups, a field takes values: 8,16")


def _keys(overrides: Sequence[str]) -> set[str]:
    return {text.split("=")[0].lstrip("+") for text in overrides}
