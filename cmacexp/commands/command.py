"""Common parts of the commands: arguments, exit codes, and the handling of errors and interrupts."""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from cmacexp.data.manifest import MANIFEST
from cmacexp.data.version import __version__
from cmacexp.errors import BadComponent, CmacexpError, format_user_traceback, in_one_line
from cmacexp.jit.interrupt import handled, interrupted_exit_code, is_interrupt
from cmacexp.terminal.output import keep_outputs, print_line, write_output

Arguments = argparse.Namespace
"""Parsed arguments of a command, as attributes."""
Work = Callable[[Arguments], int | None]
"""Function of the arguments of a command that returns its exit code; None counts as 0."""
OptionTable = Mapping[str, Mapping[str, Any]]
"""Arguments and options of a command by name, each with the keyword arguments of ``add_argument``."""
LATEST = "latest"
"""Argument that stands for the newest result below ``OUTPUTS``."""
OUTPUTS = Path("outputs")
"""Folder of the results of runs and sweeps without a folder of their own."""


def parse_folder(text: str) -> Path:
    """Return the folder that an argument names; ``latest`` is the newest run or sweep below ``outputs``.

    Nothing is stored for it, so that no run changes the result of another one. A folder of that name is preferred.

    Raises:
        ArgumentTypeError: there is no result below ``outputs``.
    """
    if text != LATEST or Path(text).exists():
        return Path(text)
    found = [path for pattern in ("[!.]*", "[!.]*/[!.]*") for path in OUTPUTS.glob(f"{pattern}/{MANIFEST}")]
    results = [path for path in found if not (path.parent.parent / MANIFEST).exists()]  # neither jobs nor reports
    if not results:
        raise argparse.ArgumentTypeError(f"{LATEST}: no run or sweep below {OUTPUTS}; type the folder of one")
    return max(results, key=lambda path: path.stat().st_mtime_ns).parent


FOLDERS: OptionTable = {
    "folders": {
        "nargs": "+",
        "type": parse_folder,
        "metavar": "DIR",
        "help": f"a run, or a folder of runs; {LATEST}: the newest below {OUTPUTS}",
    }
}
OVERRIDES: OptionTable = {
    "overrides": {"nargs": "*", "metavar": "KEY=VALUE", "help": "overrides of the config, as in cmacexp run"},
}
COMPLETED, FAILED, BAD_INPUT, STOPPED, NOT_INTACT = range(5)
"""Exit codes; :func:`cmacexp.jit.interrupt.interrupted_exit_code` gives that of an interrupted command."""


def report_usage(parser: argparse.ArgumentParser, message: str) -> NoReturn:
    """Print an error in the arguments of a command, in one line like all errors, and exit."""
    parser.exit(BAD_INPUT, f"error: {in_one_line(message)}; {parser.prog} --help shows how it is used\n")


def make_flag(meaning: str) -> dict[str, Any]:
    """Make an option without a value, False by default; ``meaning`` is its line in the help."""
    return {"action": "store_true", "help": meaning}


class Parser(argparse.ArgumentParser):
    """Parser of the arguments of the command ``python -m name``."""

    error = report_usage

    def __init__(self, name: str, description: str, options: OptionTable):
        super().__init__(prog=f"python -m {name}", description=description)
        self.add_argument("--version", action="version", version=f"cmacexp {__version__}")
        for option, described in options.items():
            self.add_argument(option, **described)

    def run(self, work: Work, hint: str = "") -> int:
        """Parse the arguments of this process, do the ``work`` of the command, and return the exit code.

        See :func:`run_command` for ``hint`` and errors.
        """
        return run_command(lambda: work(self.parse_intermixed_args()), hint)


def command(name: str, description: str, options: OptionTable) -> Callable[[Work], Callable[[], int]]:
    """Make a decorator that turns the work of the command ``name`` into its ``main``.

    ``main`` parses the arguments of this process and returns the exit code.
    """

    def make_main(work: Work) -> Callable[[], int]:
        return lambda: Parser(f"cmacexp {name}", description, options).run(work)

    return make_main


def run_command(work: Callable[[], int | None], hint: str = "") -> int:
    """Do the work of a command and return its exit code.

    Errors of this project mean bad input; they and errors of the operating system, such as a full disk, are printed
    in one line without a stack trace. Any other error is raised. ``hint`` is printed after an interrupt.
    """
    keep_outputs()
    try:
        with handled():
            try:
                return work() or COMPLETED
            except BrokenPipeError:  # the reader of the output has stopped
                return FAILED
            except (KeyboardInterrupt, Exception) as error:
                return _report(error, hint)
    finally:
        for stream in (sys.stdout, sys.stderr):
            write_output(stream)


def _report(error: BaseException, hint: str) -> int:
    """Print the error that ended a command in one line, and return the exit code; raises any unexpected error."""
    if is_interrupt(error):
        print_line(f"interrupted{hint}", error=True)
        return interrupted_exit_code()
    if not isinstance(error, CmacexpError | OSError | MemoryError):
        raise error
    if isinstance(error, BadComponent):  # with the traceback of the user's code
        print(format_user_traceback(error.raised), file=sys.stderr, end="")
    if isinstance(error, FileNotFoundError) and error.filename is None:  # the current folder
        error = CmacexpError("the current folder is gone: change to another one")
    print_line(f"error: {str(error).strip() or type(error).__name__}", error=True)
    return BAD_INPUT if isinstance(error, CmacexpError) else FAILED
