"""The runs of studies: found by the hash of their config if they are complete, else run, on all cores."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cmacexp.config import Config, config_hash, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.data.files import alone_in
from cmacexp.data.integrity import is_finished
from cmacexp.data.parquet import read_table, write_table
from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Link, relative
from pipelines.shared.workers import Each

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

HASH_DIGITS = 12


class Runs(dict[str, StoredRun]):
    """The runs of a study by the study's names for them."""

    def __init__(self, runs: Mapping[str, StoredRun], report: Path):
        super().__init__(runs)
        self.report = report
        """Folder of their report."""
        self._kept: set[Path] = set()

    def links(self, *names: str) -> list[Link]:
        """Folders of runs as seen from the report, for the claims that rest on them."""
        return [Link(name, relative(self[name].folder, self.report)) for name in names]

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
    """Folder of the run of ``overrides``, its config, and whether it is complete."""
    config = compose_config([*overrides, "record=trace"])
    kept = ("-thin" if config.record.thins else "") + ("-weights" if config.record.weights else "")
    folder = store / f"{config.scenario}-{config_hash(to_plain(config))[:HASH_DIGITS]}{kept}"
    return folder, config, is_finished(folder, config)


def _run(folder: Path, config: Config) -> None:
    from cmacexp.experiment import run_scenario

    folder.mkdir(parents=True, exist_ok=True)
    with alone_in(folder):
        if not is_finished(folder, config):  # another study may have run it while this one waited
            run_scenario(config, folder)


def _announce_compiling() -> None:
    from cmacexp.jit.compiler import cache_folder
    from cmacexp.report.terminal import COMPILING

    if not any(cache_folder().rglob("*.nbi")):
        print(COMPILING, file=sys.stderr)


def collect(
    each: Each, jobs: Mapping[str, Mapping[str, Sequence[str]]], store: Path
) -> dict[str, dict[str, StoredRun]]:
    """The runs of several studies; equal ones are run once, complete ones not at all.

    Args:
        each: runs work on all cores.
        jobs: overrides by study and name.
        store: folder of all runs.

    Raises:
        CmacexpError: overrides that cannot be run.
    """
    wanted = sorted({tuple(overrides) for study in jobs.values() for overrides in study.values()})
    found = dict(zip(wanted, each("looking for runs", _look_up, [(o, store) for o in wanted]), strict=True))
    missing = {folder: config for folder, config, finished in found.values() if not finished}
    print(f"{len(found)} runs, {len(missing)} of them to be run", file=sys.stderr)
    if missing:
        _announce_compiling()
        each("running", _run, list(missing.items()))
    stored = {overrides: StoredRun(folder) for overrides, (folder, _, _) in found.items()}
    return {study: {name: stored[tuple(o)] for name, o in own.items()} for study, own in jobs.items()}
