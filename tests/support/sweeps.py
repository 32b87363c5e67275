"""Sweeps in this process, and their tables."""

from pathlib import Path
from subprocess import CompletedProcess

import pandas as pd
from support.command import call


def sweep(*words: object, folder: Path) -> CompletedProcess:
    """The sweep of these words in ``folder / "s"``."""
    return call("main", "-m", *words, "hydra.sweep.dir=s", folder=folder)


def table_of(folder: Path) -> pd.DataFrame:
    """The table of that sweep."""
    return pd.read_parquet(folder / "s" / "sweep.parquet")
