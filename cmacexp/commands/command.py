"""What the commands share: their arguments, their exit codes, and how an error or an interrupt ends them."""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from cmacexp.data.version import __version__
from cmacexp.errors import BadComponent, CmacexpError, format_user_traceback, in_one_line
from cmacexp.jit.interrupt import handled, interrupted_exit_code, is_interrupt
from cmacexp.terminal.output import keep_outputs, print_line, write_output

Arguments = argparse.Namespace
"""Those of a command, by the names of its options."""
Work = Callable[[Arguments], int | None]
"""What a command does; its exit code, 0 if it returns none."""
OptionTable = Mapping[str, Mapping[str, Any]]
"""What a command takes: arguments and options by their names, each with what ``add_argument`` takes of it."""
FOLDERS: OptionTable = {
    "folders": {"nargs": "+", "type": Path, "metavar": "DIR", "help": "a run, or a folder of runs"}
}
OVERRIDES: OptionTable = {
    "overrides": {"nargs": "*", "metavar": "KEY=VALUE", "help": "overrides as of python -m cmacexp"},
}
COMPLETED, FAILED, BAD_INPUT, STOPPED, NOT_INTACT = range(5)
"""Exit codes; that of an interrupted command is :func:`cmacexp.jit.interrupt.interrupted_exit_code`."""


def report_usage(parser: argparse.ArgumentParser, message: str) -> NoReturn:
    """Print what is wrong with the arguments of a command, in one line as all errors are, and exit."""
    parser.exit(BAD_INPUT, f"error: {in_one_line(message)}; {parser.prog} --help shows how it is used\n")


def make_flag(meaning: str) -> dict[str, Any]:
    """An option without a value, off unless given; ``meaning`` is its line of the help."""
    return {"action": "store_true", "help": meaning}


class Parser(argparse.ArgumentParser):
    """Reads the arguments of a command, of the module ``name``."""

    error = report_usage

    def __init__(self, name: str, description: str, options: OptionTable):
        super().__init__(prog=f"python -m {name}", description=description)
        self.add_argument("--version", action="version", version=f"cmacexp {__version__}")
        for option, described in options.items():
            self.add_argument(option, **described)

    def run(self, work: Work, hint: str = "") -> int:
        """Read the arguments of this process, and do the ``work`` of the command; see :func:`run_command`."""
        return run_command(lambda: work(self.parse_intermixed_args()), hint)


def command(name: str, description: str, options: OptionTable) -> Callable[[Work], Callable[[], int]]:
    """Make the ``main`` of a command, which reads the arguments of this process and returns the exit code.

    It decorates the function that does the work of the command of this name.
    """

    def make_main(work: Work) -> Callable[[], int]:
        return lambda: Parser(f"cmacexp {name}", description, options).run(work)

    return make_main


def run_command(work: Callable[[], int | None], hint: str = "") -> int:
    """Do the work of a command; its exit code, 0 if it returns none. ``hint`` says what to do after an interrupt.

    Errors of this project are about its input. Errors of the operating system, such as a full disk, need no stack
    trace; any other error is raised.
    """
    keep_outputs()
    try:
        with handled():
            try:
                return work() or COMPLETED
            except BrokenPipeError:  # who reads the output needs no more of it
                return FAILED
            except (KeyboardInterrupt, Exception) as error:
                return _report(error, hint)
    finally:
        for stream in (sys.stdout, sys.stderr):
            write_output(stream)


def _report(error: BaseException, hint: str) -> int:
    """Report what ended a command in a line; its exit code. Raises an error that is none of the input or system."""
    if is_interrupt(error):
        print_line(f"interrupted{hint}", error=True)
        return interrupted_exit_code()
    if not isinstance(error, CmacexpError | OSError | MemoryError):
        raise error
    if isinstance(error, BadComponent):  # what its own code raised
        print(format_user_traceback(error.raised), file=sys.stderr, end="")
    if isinstance(error, FileNotFoundError) and error.filename is None:  # that of the current folder
        error = CmacexpError("the current folder is gone: change to another one")
    print_line(f"error: {str(error).strip() or type(error).__name__}", error=True)
    return BAD_INPUT if isinstance(error, CmacexpError) else FAILED
