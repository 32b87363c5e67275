"""All private names of Hydra that this project uses; ``pyproject.toml`` allows only versions that have them."""

import sys
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from types import MethodType
from typing import Any

from hydra.core.override_parser.types import Override
from hydra.types import HydraContext, RunMode
from omegaconf import DictConfig

CORE_PLUGINS = "hydra._internal.core_plugins"
GRID, BASIC = f"{CORE_PLUGINS}.basic_sweeper.BasicSweeper", f"{CORE_PLUGINS}.basic_launcher.BasicLauncher"
"""Hydra's own sweeper, whose jobs are known before the first one runs, and its own launcher."""


def skip_mode_lookup(arguments: Sequence[str]) -> None:
    """Keep Hydra from composing the whole config once more, only to read ``hydra.mode`` in it.

    No shipped config sets ``hydra.mode``; where the command line could, Hydra looks as usual. Measured by
    ``benchmarks/command.py``, row "without Hydra's private names".
    """
    if not any("hydra.mode" in text or text.startswith(("-cd", "-cn", "-cp", "--config-")) for text in arguments):
        from hydra._internal.hydra import Hydra

        Hydra.get_mode = lambda self, config_name, overrides: None  # type: ignore[method-assign, assignment]


def report_parser_errors(report: Callable[[ArgumentParser, str], None]) -> None:
    """Have Hydra's parser of the command line call ``report``, where it would print nine lines and exit."""
    from hydra._internal.utils import get_args_parser

    def make_parser() -> ArgumentParser:
        parser = get_args_parser()
        parser.prog, parser.error = "python -m cmacexp", MethodType(report, parser)  # type: ignore[method-assign]
        return parser

    vars(sys.modules["hydra.main"])["get_args_parser"] = make_parser  # ``hydra.main`` itself is the function


def take_over_sweeps(run_sweep: Callable[[DictConfig, HydraContext], None]) -> None:
    """Have Hydra call ``run_sweep`` with the config of a sweep, where it would compose each of its jobs twice.

    Measured by ``benchmarks/sweep.py``, row "cores".
    """
    from hydra._internal.callbacks import Callbacks
    from hydra._internal.hydra import Hydra

    def multirun(hydra: Hydra, config_name: str, task_function: object, overrides: list[str]) -> None:
        config = hydra.compose_config(config_name, overrides, RunMode.MULTIRUN, with_log_configuration=True)
        run_sweep(config, HydraContext(hydra.config_loader, Callbacks(config)))

    Hydra.multirun = multirun  # type: ignore[method-assign, assignment]


def expand_grid(overrides: list[Override], most: int | None) -> Any:
    """The overrides of the jobs of Hydra's own sweeper, in batches of ``most`` jobs; None: in one."""
    from hydra._internal.core_plugins.basic_sweeper import BasicSweeper

    return BasicSweeper.split_arguments(overrides, most)
