"""Jobs of a sweep, in whatever process: found if they are finished, else run; and how a failure is left on disk."""

import json
import pickle
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import setup_globals
from omegaconf import DictConfig, OmegaConf, open_dict

from cmacexp.config import Config, config_hash, to_config, to_plain
from cmacexp.config.compose import make_record
from cmacexp.config.template import ConfigTemplate
from cmacexp.data import manifest as manifests
from cmacexp.data.folder import RUN_KEY, check_place, new_result
from cmacexp.data.integrity import compute_hashes, is_finished
from cmacexp.data.run import Run
from cmacexp.engine.chunk import Chunk
from cmacexp.engine.equal_results import describe_result
from cmacexp.engine.objective import check_metric
from cmacexp.engine.run import describe_run, run_scenario
from cmacexp.engine.sweep_tables import (
    FINGERPRINT,
    HASHES,
    JobItem,
    JobTables,
    concat_metrics,
    find_fingerprint,
    make_column,
    make_table,
    read_metrics,
    select_run_overrides,
    write_part,
)
from cmacexp.errors import BadComponent, BadInput, CmacexpError, describe_failure, format_user_traceback
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.metrics.drift import make_drift_entry
from cmacexp.metrics.registry import make_rows
from cmacexp.terminal.messages import describe_drift, describe_idle, format_outcome
from cmacexp.typing import Status


def write_failure(
    folder: Path,
    composed: DictConfig | dict[str, Any],
    error: Exception,
    record: Mapping[str, str] | None = None,
    **entries: Any,
) -> Run:
    """Leave a manifest, with further ``entries``, that says why a config gave no run; an earlier run stays."""
    # Of a config as typed: an interpolation may be what is wrong.
    plain: Any = OmegaConf.to_container(composed) if isinstance(composed, DictConfig) else composed
    entries["bad_input"] = isinstance(error, BadInput)
    if isinstance(error, BadComponent) or not isinstance(error, CmacexpError | OSError | MemoryError):
        entries["traceback"] = format_user_traceback(error.raised if isinstance(error, BadComponent) else error)
    manifest = manifests.make_manifest(plain, Status.FAILED, describe_failure(error), **entries)
    written = folder / manifests.MANIFEST
    with suppress(OSError, BadInput):  # then only the terminal and the table show it
        if not (written.exists() and manifests.read_file(written)["files"]):
            with new_result(folder, RUN_KEY) as writer:
                for name, text in (record or {}).items():
                    writer.write_text(f"{manifests.HYDRA_FOLDER}/{name}", text)
                manifests.write(writer.part, manifest)
    return Run(folder, manifest)


class JobTemplate:
    """What Hydra composed for jobs of the same keys and options, of which each sets its own values."""

    def __init__(self, composed: DictConfig):
        """Take Hydra's own part out of it."""
        plain: Any = OmegaConf.to_container(composed, enum_to_str=True)
        self._hydra = plain["hydra"]
        with open_dict(composed):
            del composed["hydra"]
        self._configs = ConfigTemplate(composed)

    def make_config(self, item: JobItem, folder: Path) -> Config:
        """The config of a job; raises BadInput."""
        if self._configs.referred is None:  # perhaps it is ${hydra:...} that values follow from
            own, hydra = self.describe(item, folder)
            vars(HydraConfig.instance())["cfg"] = OmegaConf.create({**own, "hydra": hydra})
        return to_config(self._configs.resolve(item.values))

    def describe(self, item: JobItem, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
        """The config of a job as typed, and Hydra's own part, which is that of the job until the next one."""
        job, how = self._hydra["job"], self._hydra["job"]["config"]["override_dirname"]
        named = sorted(text for text in item.overrides if text.partition("=")[0] not in how["exclude_keys"])
        job["override_dirname"] = how["item_sep"].join(named).replace("=", how["kv_sep"])
        self._hydra["overrides"]["task"], job["id"], job["num"] = item.overrides, str(item.number), item.number
        self._hydra["runtime"]["output_dir"] = str(folder)
        return self._configs.set(item.values), self._hydra


@lru_cache(8)
def _unpack(packed: bytes) -> JobTemplate:
    setup_globals()
    return JobTemplate(pickle.loads(packed))


def run_jobs(packed: bytes, root: Path, items: Sequence[JobItem], jobs: int) -> list[tuple[str, bool]]:
    """Run some of so many jobs of a sweep in this process, and hand them over as one part of its tables.

    ``packed`` is what Hydra composed for a job of the same keys and options, ``root`` the folder of the sweep.
    Returns how each ended, in a line, and whether that is an error. Raises OSError.
    """
    template, by_number = _unpack(packed), {item.number: item for item in items}
    chunk, waiting, began = Chunk(), dict[int, Config](), time.perf_counter()
    runs, finished_before = dict[int, Run](), set[int]()
    """By the numbers of their jobs; of a job that finished before there is no run if the tables have its result."""
    expect_runs(jobs)

    @contextmanager
    def failure_recorded(item: JobItem) -> Iterator[None]:
        """Leave a failure on disk, which does not end the sweep; an interrupt does."""
        try:
            yield
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            plain, hydra = template.describe(item, root / item.folder)
            record, shown = make_record(plain, hydra), select_run_overrides(item.overrides)
            runs[item.number] = write_failure(root / item.folder, plain, error, record, overrides=shown)
        if item.number in runs and runs[item.number].status == Status.INTERRUPTED:
            raise KeyboardInterrupt

    try:
        for item in items:
            folder = root / item.folder
            with failure_recorded(item):
                config = template.make_config(item, folder)
                check_metric(config.optimize, config.machine.kind)
                has_folder = config.record.trace or config.record.weights
                if not has_folder and item.known and item.known == _list_hashes(config):
                    finished_before.add(item.number)
                elif config.sweep.resume and is_finished(folder, config):
                    finished_before.add(item.number)
                    runs[item.number] = Run(folder)
                elif has_folder:
                    record = make_record(*template.describe(item, folder)) if config.record.trace else None
                    shown = select_run_overrides(item.overrides)
                    runs[item.number] = run_scenario(config, folder, record=record, overrides=shown, durable=False)
                else:
                    if folder.exists():  # this job will take its place
                        check_place(folder, RUN_KEY)
                    waiting[item.number] = config
        for number, simulate in chunk.list_runs(waiting):
            item = by_number[number]
            with failure_recorded(item):
                manifest = describe_run(*simulate()) | {"overrides": select_run_overrides(item.overrides)}
                runs[number] = Run(root / item.folder, manifest)
    finally:
        made = {item.number: runs[item.number] for item in items if item.number in runs}
        _add_scores(made, chunk, time.perf_counter() - began)
        if made:
            write_part(root, _tabulate(root, made, by_number))
            for run in made.values():  # an earlier one in the place of a run that has no folder
                if not run.is_checked and manifests.is_run(run.folder):
                    shutil.rmtree(run.folder, ignore_errors=True)
    return [_describe_end(item, None if item.number in finished_before else runs[item.number]) for item in items]


def _add_scores(runs: Mapping[int, Run], chunk: Chunk, seconds: float) -> None:
    """Add to runs that have no folders their metrics, and what their manifests say of these and of the time."""
    scored = {number: scores for number, scores in chunk.score().items() if number in runs}
    loops = sum(runs[number].manifest["rollout_seconds"] for number in scored)
    rest = max(0.0, seconds - loops) / max(1, len(scored))
    for number, scores in scored.items():
        run = runs[number]
        run.is_checked, run.scores = False, scores
        run.manifest |= {"drift": make_drift_entry(scores.legs), "files": chunk.hashes[number]}
        run.manifest["wall_seconds"] = run.manifest["rollout_seconds"] + rest


def _list_hashes(config: Config) -> tuple[str, ...]:
    """:data:`HASHES` of the run of a config."""
    return config_hash(to_plain(config)), *map(str, compute_hashes(config).values())


def _tabulate(root: Path, runs: Mapping[int, Run], items: Mapping[int, JobItem]) -> JobTables:
    """The tables of jobs whose runs and items are given by their numbers."""
    rows = []
    for (number, run), shown in zip(runs.items(), make_rows([*runs.values()], ()), strict=True):
        rows.append(
            {
                "run": number,
                "folder": run.folder.relative_to(root).as_posix(),
                "overrides": " ".join(select_run_overrides(items[number].overrides)),
                **shown,
                **{name: str(run.manifest.get(name)) for name in HASHES},
                "result": describe_result(run),
                "bad_input": run.manifest.get("bad_input", False),
                FINGERPRINT: find_fingerprint(run.folder) if run.is_checked else "",
                "manifest": json.dumps(run.manifest),
            }
        )
    metrics, index = concat_metrics([read_metrics(run) for run in runs.values()])
    numbers = make_column([rows[place]["run"] for place in index])
    return JobTables(make_table(rows), metrics.add_column(0, "run", numbers))


def _describe_end(item: JobItem, run: Run | None) -> tuple[str, bool]:
    """How a job ended, None if it had before, in a line, and whether that is an error."""
    name = f"#{item.number} {' '.join(select_run_overrides(item.overrides))}"
    if run is None:
        return f"{name}: finished before, not run again", False
    if run.status == Status.FAILED:
        name = f"#{item.number}" if "bad_input" in run.manifest else name
        return f"error: {name}: {run.manifest['cause']}", True
    notes = format_outcome(run), describe_drift(run), describe_idle(run)
    return f"{name}: {'; '.join(filter(None, notes))}", False
