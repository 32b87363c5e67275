"""What the commands share, most of which work on folders of runs."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from cmacexp.errors import CmacexpError, in_one_line
from cmacexp.jit.interrupt import end_command, heed_interrupts, interrupt_as_such
from cmacexp.report.outputs import keep_outputs


def report_usage(parser: argparse.ArgumentParser, message: str) -> NoReturn:
    """Print what is wrong with the arguments of a command, in one line as all errors are, and exit with code 2."""
    parser.exit(2, f"error: {in_one_line(message)}; {parser.prog} --help shows how it is used\n")


class Parser(argparse.ArgumentParser):
    """Reads the arguments of a command."""

    error = report_usage


def add_folders(parser: Parser) -> None:
    """The positional arguments of most commands: ``folders``."""
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="a run, or a folder of runs")


def command(
    name: str,
    description: str,
    work: Callable[[argparse.Namespace], int],
    flags: Sequence[tuple[str, str]] = (),
    values: Sequence[tuple[str, str, str]] = (),
    positional: Callable[[Parser], None] = add_folders,
) -> int:
    """Run a command, over folders of runs unless it takes other arguments.

    Args:
        name: of the module, ``cmacexp.score``.
        description: what it does, for ``--help``.
        work: takes the parsed arguments (positional ones, each flag, each value) and returns the exit code.
        flags: options without a value, each with its help.
        values: options with a value (text, None by default), each with its metavar and its help.
        positional: adds its positional arguments.

    Returns:
        The exit code: that of ``work``, 2 after an error that it raised, 130 if interrupted.
    """
    keep_outputs()
    try:
        heed_interrupts()
        with interrupt_as_such():
            return work(_parse(name, description, flags, values, positional))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except (CmacexpError, OSError) as error:
        print(f"error: {in_one_line(str(error))}", file=sys.stderr)
        return 2
    finally:
        end_command()


def _parse(
    name: str,
    description: str,
    flags: Sequence[tuple[str, str]],
    values: Sequence[tuple[str, str, str]],
    positional: Callable[[Parser], None],
) -> argparse.Namespace:
    parser = Parser(prog=f"python -m {name}", description=description)
    positional(parser)
    for flag, text in flags:
        parser.add_argument(flag, action="store_true", help=text)
    for option, metavar, text in values:
        parser.add_argument(option, metavar=metavar, help=text)
    return parser.parse_args()
