"""All private names of Hydra that this project uses; another version does without, slower or wordier."""

import contextlib
import pickle
import sys
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from types import MethodType
from typing import Any

from hydra import __version__

KNOWN = "1.3."
"""The version whose private names these are."""


def skip_mode_lookup(arguments: Sequence[str]) -> None:
    """Keep Hydra from composing the whole config once more, only to read ``hydra.mode`` in it.

    No shipped config sets ``hydra.mode``; where the command line could, Hydra looks as usual. Measured by
    ``benchmarks/command.py``, row "without Hydra's private names".

    Args:
        arguments: the command line.
    """
    if __version__.startswith(KNOWN) and not any(
        "hydra.mode" in text or text.startswith(("-cd", "-cn", "-cp", "--config-")) for text in arguments
    ):
        from hydra._internal.hydra import Hydra

        Hydra.get_mode = lambda self, config_name, overrides: None  # type: ignore[method-assign, assignment]


def report_parser_errors(report: Callable[[ArgumentParser, str], None]) -> None:
    """Have Hydra's parser of the command line call ``report``, where it would print nine lines and exit."""
    if not __version__.startswith(KNOWN):
        return
    from hydra._internal.utils import get_args_parser

    def make_parser() -> ArgumentParser:
        parser = get_args_parser()
        parser.prog, parser.error = "python -m cmacexp", MethodType(report, parser)  # type: ignore[method-assign]
        return parser

    vars(sys.modules["hydra.main"])["get_args_parser"] = make_parser  # ``hydra.main`` itself is the function


def read_config_files_once(hydra: Any) -> None:
    """Keep Hydra from reading some 30 config files anew for each job of a sweep.

    Measured by ``benchmarks/sweep.py``, row "without Hydra's private names".

    Args:
        hydra: the instance of :class:`hydra.core.global_hydra.GlobalHydra`.
    """
    if __version__.startswith(KNOWN):
        loader = hydra.config_loader
        loader.repository = _CachedRepository(loader.repository, {})


class _CachedRepository:
    """Hydra's repository of configs, which reads each file once."""

    def __init__(self, repository: Any, files: dict[str, bytes]):
        self.repository = repository
        self.files = files

    def __getattr__(self, name: str) -> Any:
        return getattr(self.repository, name)

    def __deepcopy__(self, memo: object) -> "_CachedRepository":
        return self  # Hydra copies its repository for every job

    def __reduce__(self) -> tuple[Any, ...]:
        return _CachedRepository, (self.repository, self.files)

    def load_config(self, config_path: str) -> Any:
        """The content of the file, new for each caller, which may change it."""
        if config_path in self.files:
            return pickle.loads(self.files[config_path])
        loaded = self.repository.load_config(config_path=config_path)
        with contextlib.suppress(pickle.PicklingError):  # as with the schemas of plugins in a worker
            self.files[config_path] = pickle.dumps(loaded)
        return loaded
