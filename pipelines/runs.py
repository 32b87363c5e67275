"""The runs of studies: found by the hash of their config where they are finished, else run, on all cores."""

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmacexp.config import Config, config_hash, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.finished import is_finished
from cmacexp.report.page import relative
from cmacexp.stored import StoredRun
from cmacexp.table import read_table, write_table

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

HASH_DIGITS = 12


class Runs(dict[str, StoredRun]):
    """The runs of a study by its own names of them."""

    def __init__(self, runs: Mapping[str, StoredRun], report: Path):
        super().__init__(runs)
        self.report = report
        """Folder of the report that tells of them."""
        self._kept: set[Path] = set()

    def links(self, *names: str) -> list[str]:
        """Folders of runs as seen from the report, for the claims that rest on them."""
        return [relative(self[name].folder, self.report) for name in names]

    def keep(self, name: str, table: "pa.Table") -> "pd.DataFrame":
        """Keep a table that was computed without a run beside the report, which lists it; as it was read back."""
        path = self.report / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_table(table, path)
        self._kept.add(path)
        return read_table(path).to_pandas()

    @property
    def files(self) -> set[Path]:
        """Every file of these runs that their manifests list, and every table that was kept."""
        return self._kept | {run.folder / name for run in self.values() for name in run.manifest["files"]}


def _look_up(overrides: Sequence[str], store: Path) -> tuple[Path, Config, bool]:
    """Where the run of ``overrides`` stands, its config, and whether it is finished."""
    config = compose_config([*overrides, "record=trace"])
    folder = store / f"{config.scenario}-{config_hash(to_plain(config))[:HASH_DIGITS]}"
    return folder, config, is_finished(folder, config)


def _run(folder: Path, config: Config) -> None:
    from cmacexp.run import run_scenario

    run_scenario(config, folder)


def _announce_compiling() -> None:
    from cmacexp.cli import COMPILING
    from cmacexp.compile import CACHE_FOLDER

    if not any(CACHE_FOLDER.rglob("*.nbi")):
        print(COMPILING, file=sys.stderr)


@contextmanager
def _progress(what: str, total: int) -> Iterable[Callable[[], None]]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)


def _each(pool: ProcessPoolExecutor, what: str, work: Callable[..., Any], items: Sequence[tuple]) -> list[Any]:
    """``work`` of every item, on all cores, in order."""
    futures = [pool.submit(work, *item) for item in items]
    with _progress(what, len(items)) as advance:
        for future in as_completed(futures):
            future.result()
            advance()
    return [future.result() for future in futures]


def collect(jobs: Mapping[str, Mapping[str, Sequence[str]]], store: Path) -> dict[str, dict[str, StoredRun]]:
    """The runs of several studies; equal ones are run once, finished ones not at all.

    Args:
        jobs: overrides by study and name.
        store: folder of all runs.

    Raises:
        CmacexpError: overrides that cannot be run.
    """
    wanted = sorted({tuple(overrides) for study in jobs.values() for overrides in study.values()})
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        found = dict(zip(wanted, _each(pool, "configs", _look_up, [(o, store) for o in wanted]), strict=True))
        missing = {folder: config for folder, config, finished in found.values() if not finished}
        print(f"{len(found)} runs, {len(missing)} of them to be run", file=sys.stderr)
        if missing:
            _announce_compiling()
            _each(pool, "runs", _run, list(missing.items()))
    stored = {overrides: StoredRun(folder) for overrides, (folder, _, _) in found.items()}
    return {study: {name: stored[tuple(o)] for name, o in own.items()} for study, own in jobs.items()}
