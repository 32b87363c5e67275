"""Sweeps in this process, each as if it were the first."""

from pathlib import Path
from subprocess import CompletedProcess
from unittest.mock import patch

import pandas as pd
from support import command


def call(name: str, *words: object, folder: Path | None = None) -> CompletedProcess:
    """A command that may be a sweep, of which a process remembers one."""
    with patch("cmacexp.experiment.sweep.Sweep.current", None):
        return command.call(name, *words, folder=folder)


def sweep(*words: object, folder: Path) -> CompletedProcess:
    """The sweep of these words in ``folder / "s"``."""
    return call("main", "-m", *words, "hydra.sweep.dir=s", folder=folder)


def table_of(folder: Path) -> pd.DataFrame:
    """The table of that sweep."""
    return pd.read_parquet(folder / "s" / "sweep.parquet")
