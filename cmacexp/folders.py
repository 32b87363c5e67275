"""Runs on disk: finding them, and what the commands that read them share."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from cmacexp import manifest as manifests
from cmacexp.errors import BadInput, BadRun, CmacexpError


def is_run(folder: Path) -> bool:
    """Whether ``folder`` is, or was to become, the folder of a run."""
    named = any((folder / name).exists() for name in (manifests.NAME, "trace.parquet", ".hydra"))
    return named and not manifests.is_report(folder)


def runs_below(folder: Path, reports: bool = False) -> list[Path]:
    """``folder`` if it is a run, else all runs below it, in order.

    Args:
        folder: where to look.
        reports: take folders of reports as well.

    Raises:
        BadRun: the folder does not exist or holds no run.
    """
    if not folder.is_dir():
        raise BadRun(f"{folder}: no such folder")
    if is_run(folder) or (reports and manifests.is_report(folder)):
        return [folder]
    found = sorted({path.parent for path in folder.rglob("*") if path.name in (manifests.NAME, ".hydra")})
    found = [path for path in found if reports or is_run(path)]
    if not found:
        raise BadRun(f"{folder}: holds no run; give the folder that a run printed at its end")
    return found


def require_place(key: str, folder: Path) -> Path:
    """``folder`` if it is one or can become one.

    Raises:
        BadInput: a file stands there or above it.
    """
    for path in (folder, *folder.parents):
        if path.exists():
            if not path.is_dir():
                raise BadInput(key, folder, f"{path} is a file; choose a folder, it is made if missing")
            break
    return folder


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
