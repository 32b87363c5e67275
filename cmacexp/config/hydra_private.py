"""All private names of Hydra that this project uses; ``pyproject.toml`` allows only versions that have them."""

import sys
from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from types import MethodType


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
