"""What all commands over folders of runs share."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from cmacexp.errors import CmacexpError


def command(
    name: str,
    description: str,
    work: Callable[[argparse.Namespace], int],
    options: Sequence[tuple[str, str]] = (),
    values: Sequence[tuple[str, str, str]] = (),
) -> int:
    """Run a command over folders of runs.

    Args:
        name: the module, ``cmacexp.score``.
        description: what it does, for ``--help``.
        work: takes the parsed arguments (``folders``, and each flag) and gives the exit code.
        options: flags, each with its help.
        values: options that take a value, each with what stands for it and its help; text, None if not given.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {name}", description=description)
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="a run, or a folder of runs")
    for flag, text in options:
        parser.add_argument(flag, action="store_true", help=text)
    for flag, metavar, text in values:
        parser.add_argument(flag, metavar=metavar, help=text)
    try:
        return work(parser.parse_args())
    except KeyboardInterrupt:
        return 130
    except (CmacexpError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
