"""One of many runs, of a sweep or of a study, in whatever process: found if it is finished, else run."""

import json
import pickle
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from threading import get_ident
from typing import Any, NamedTuple

from hydra.conf import HydraConf
from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import setup_globals
from omegaconf import DictConfig, OmegaConf, open_dict

from cmacexp.config import Config, config_hash, to_config, to_plain
from cmacexp.config.component import COMPONENTS, is_shipped
from cmacexp.config.compose import find_referred, make_record, set_plain_values, set_values
from cmacexp.data import manifest as manifests
from cmacexp.data.folder import RUN_KEY, new_result
from cmacexp.data.integrity import compute_hashes, is_finished
from cmacexp.data.run import Run
from cmacexp.engine.job_store import (
    FINGERPRINT,
    HASHES,
    JobItem,
    JobTables,
    find_fingerprint,
    iterate_jobs,
    write_part,
)
from cmacexp.engine.objective import check_metric
from cmacexp.engine.run import describe_run, describe_scores, run_scenario, score_run
from cmacexp.engine.slurm import is_restarted
from cmacexp.engine.sweep_tables import concat_metrics, make_column, make_table, read_metrics, select_run_overrides
from cmacexp.engine.without_effect import IdleKeys
from cmacexp.errors import BadComponent, BadInput, CmacexpError, describe_failure, format_user_traceback
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.registry import make_rows
from cmacexp.planning import Recall
from cmacexp.terminal.messages import describe_drift, describe_idle
from cmacexp.typing import Status

PART_SECONDS = 1.0
"""After which a worker hands over what it has done: a kill loses no more."""


def ensure_run(
    config: Config,
    folder: Path,
    runs: int,
    reuse: bool = True,
    record: Mapping[str, str] | None = None,
    overrides: list[str] | None = None,
) -> tuple[Run, bool]:
    """Return the run of a config, and whether it was executed; with ``reuse`` a finished one in ``folder`` is not.

    ``runs`` is the number of runs that this is one of. ``record``, ``overrides`` and errors are those of
    :func:`cmacexp.engine.run.run_scenario`.
    """
    if reuse and is_finished(folder, config):
        return Run(folder), False
    expect_runs(runs)
    return run_scenario(config, folder, record=record, overrides=overrides, durable=overrides is None), True


def write_failure(
    folder: Path,
    composed: DictConfig | dict[str, Any],
    error: Exception,
    record: Mapping[str, str] | None = None,
    **entries: Any,
) -> Run:
    """Leave a manifest, with further ``entries``, that says why a config gave no run; an earlier result stays."""
    # Of a config as typed: an interpolation may be what is wrong.
    plain: Any = OmegaConf.to_container(composed) if isinstance(composed, DictConfig) else composed
    entries["bad_input"] = isinstance(error, BadInput)
    if isinstance(error, BadComponent) or not isinstance(error, CmacexpError | OSError | MemoryError):
        entries["traceback"] = format_user_traceback(error.raised if isinstance(error, BadComponent) else error)
    manifest = manifests.make_manifest(plain, Status.FAILED, describe_failure(error), **entries)
    with suppress(OSError, BadInput):  # then only the terminal and the table show it
        with new_result(folder, RUN_KEY) as writer:
            for name, text in (record or {}).items():
                writer.write_text(f"{manifests.HYDRA_FOLDER}/{name}", text)
            manifests.write(writer.part, manifest)
            writer.status = Status.FAILED
        return Run(writer.folder, manifest)
    return Run(folder, manifest)


class JobTemplate(NamedTuple):
    """What Hydra composed for jobs of the same keys and options, in the forms in which their values are set."""

    composed: DictConfig
    """The config without Hydra's own part; it holds the values of the last job that needed it."""
    hydra: dict[str, Any]
    """Hydra's own part, with the values of that job."""
    plain: Any
    """The config for :func:`set_plain_values`; pickled if a component is custom, so that each job has its own."""
    typed: Any
    """The typed config, in the same way; None if it is wrong, or ``referred`` is None."""
    referred: frozenset[str] | None
    """Keys from which other values follow, see :func:`find_referred`."""


@lru_cache(8)
def _unpack(packed: bytes, thread: int) -> JobTemplate:
    """Unpack a template, once for each ``thread``, since each job sets its values in it."""
    setup_globals()
    composed = pickle.loads(packed)
    typed_config = None
    plain: Any = OmegaConf.to_container(composed, enum_to_str=True)
    hydra = plain.pop("hydra")
    with open_dict(composed):
        del composed["hydra"]
    referred = find_referred(composed)
    with suppress(Exception):  # which each job reports
        typed_config = None if referred is None else to_config(composed)
    modules = [type(vars(typed_config)[group]).__module__ for group in COMPONENTS] if typed_config is not None else []
    if all(map(is_shipped, modules)):
        return JobTemplate(composed, hydra, plain, typed_config, referred)
    return JobTemplate(composed, hydra, pickle.dumps(plain), pickle.dumps(typed_config), referred)


def _describe_job(hydra: Any, item: JobItem, folder: Path) -> None:
    """Set the entries that describe a job in Hydra's own part of a config."""
    job, how = hydra["job"], hydra["job"]["config"]["override_dirname"]
    named = sorted(text for text in item.overrides if text.partition("=")[0] not in how["exclude_keys"])
    job["override_dirname"] = how["item_sep"].join(named).replace("=", how["kv_sep"])
    hydra["overrides"]["task"], job["id"], job["num"] = item.overrides, str(item.number), item.number
    hydra["runtime"]["output_dir"] = str(folder)


def run_jobs(packed: bytes, root: Path, sweep: str, items: Sequence[JobItem], jobs: int) -> list[tuple[str, bool]]:
    """Run some of so many jobs of a sweep in this process, and hand them over as one part of its tables.

    ``packed`` is what Hydra composed for a job of the same keys and options, ``root`` the folder of the sweep, whose
    parts have the name ``sweep``.
    Returns how each ended, in a line, and whether that is an error. Raises OSError.
    """
    template = _unpack(packed, get_ident())
    runner = JobRunner()
    expect_runs(jobs)
    # In a row, as run_chunk does.
    typed_config = template.typed
    referred = template.referred or frozenset()
    configs = [set_plain_values(typed_config, item.values, referred) if typed_config else None for item in items]
    done = _list_done(root, sweep)
    runs = dict[int, Run]()
    numbered = {item.number: item for item in items}
    lines = list[tuple[str, bool]]()
    written = time.monotonic()
    try:
        for item, config in zip(items, configs, strict=True):
            run, is_new = None, False
            if item.number not in done:
                run, is_new = runner.run_item(template, root, item, jobs, config)
            if run is not None:
                runs[item.number] = run
                if run.status == Status.INTERRUPTED:
                    raise KeyboardInterrupt
            lines.append(_describe_end(item, run, is_new))
            if runs and time.monotonic() > written + PART_SECONDS:
                write_part(root, sweep, _tabulate(root, runs, numbered, runner.idle))
                runs = {}
                written = time.monotonic()
    finally:
        if runs:
            write_part(root, sweep, _tabulate(root, runs, numbered, runner.idle))
    return lines


def _list_done(root: Path, sweep: str) -> set[int]:
    """List the numbers of the jobs that a task had done before SLURM started it again."""
    parts = manifests.list_job_parts(root, sweep) if is_restarted() else ()
    return {number for jobs, _ in iterate_jobs(parts) for number in jobs["run"].to_pylist()}


class JobRunner:
    """Runs jobs of a sweep in this process, one after the other, of which many share a plan."""

    def __init__(self) -> None:
        self._recall = Recall()
        self._idle_keys = IdleKeys()
        self.idle = dict[int, dict[str, str]]()
        """Keys without effect, by the numbers of jobs."""

    def run_item(
        self, template: JobTemplate, root: Path, item: JobItem, jobs: int, config: Config | None
    ) -> tuple[Run | None, bool]:
        """Run one of so many jobs, of this config if it is known already; a failure is left on disk.

        Returns the run, None if the tables have its result, and whether it was made now.
        """
        try:
            return self._run_item(template, root, item, jobs, config)
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            composed = _compose(template, root, item)
            overrides = select_run_overrides(item.overrides)
            record = make_record(composed, template.hydra)
            return write_failure(root / item.folder, composed, error, record, overrides=overrides), True

    def _run_item(
        self, template: JobTemplate, root: Path, item: JobItem, jobs: int, config: Config | None
    ) -> tuple[Run | None, bool]:
        folder = root / item.folder
        composed = None
        if config is None:
            config = to_config(composed := _compose(template, root, item))
        check_metric(config.optimize, config.machine.kind)
        overrides = select_run_overrides(item.overrides)
        keeps_files = config.record.trace or config.record.weights
        if not keeps_files:
            if item.known and item.known == _hash(config):
                return None, False
            if config.sweep.resume and is_finished(folder, config):
                return Run(folder), False
            run, is_new = self._run_in_memory(config, folder, overrides), True
        else:
            _describe_job(template.hydra, item, folder)
            composed = composed or set_plain_values(template.plain, item.values) or _compose(template, root, item)
            record = make_record(composed, template.hydra) if config.record.trace else None
            run, is_new = ensure_run(config, folder, jobs, config.sweep.resume, record, overrides)
        self.idle[item.number] = self._idle_keys.find(config, overrides, partial(_compose, template, root, item))
        return run, is_new

    def _run_in_memory(self, config: Config, folder: Path, overrides: list[str]) -> Run:
        """Run a config; the run has no files, but metrics, and hashes of their values."""
        began = time.perf_counter()
        scenario = make_scenario(config, None, self._recall)
        scores = score_run(scenario)
        run = Run(folder, describe_run(scenario) | describe_scores(scores) | {"overrides": overrides})
        run.is_checked = False
        run.scores = scores
        run.manifest["wall_seconds"] = time.perf_counter() - began
        return run


def _hash(config: Config) -> tuple[str, ...]:
    """Hash all on which the result of a config depends, as :data:`HASHES` of a manifest."""
    return config_hash(to_plain(config)), *map(str, compute_hashes(config).values())


def _compose(template: JobTemplate, root: Path, item: JobItem) -> DictConfig:
    """Compose the config of a job by setting its values in the template, which holds it until the next job."""
    _describe_job(template.hydra, item, root / item.folder)
    composed = template.composed
    set_values(composed, item.values)
    if template.referred is None:  # perhaps it is ${hydra:...} that values follow from
        own: Any = OmegaConf.to_container(composed)
        hydra = OmegaConf.structured(HydraConf)
        with open_dict(hydra):
            hydra.merge_with(template.hydra)
        HydraConfig.instance().set_config(OmegaConf.create({**own, "hydra": hydra}))
    return composed


def _tabulate(
    root: Path, runs: Mapping[int, Run], items: Mapping[int, JobItem], idle: Mapping[int, Mapping[str, str]]
) -> JobTables:
    """Tabulate jobs by their numbers, with the keys that have no effect in them."""
    rows = []
    for (number, run), shown in zip(runs.items(), make_rows([*runs.values()], ()), strict=True):
        rows.append(
            {
                "run": number,
                "folder": run.folder.relative_to(root).as_posix(),
                "overrides": " ".join(select_run_overrides(items[number].overrides)),
                **shown,
                **{name: str(run.manifest[name]) for name in HASHES},
                "idle": json.dumps(idle.get(number, {})),
                "bad_input": bool(run.manifest["bad_input"]),
                FINGERPRINT: find_fingerprint(run.folder) if run.is_checked else "",
                "manifest": json.dumps(run.manifest),
            }
        )
    metrics, index = concat_metrics([read_metrics(run) for run in runs.values()])
    numbers = make_column([rows[place]["run"] for place in index])
    return JobTables(make_table(rows), metrics.add_column(0, "run", numbers))


def _describe_end(item: JobItem, run: Run | None, is_new: bool) -> tuple[str, bool]:
    """Describe in a line how a job ended; returns it and whether that is an error."""
    name = f"#{item.number} {' '.join(select_run_overrides(item.overrides))}"
    if run is None or not is_new:
        return f"{name}: finished before, not run again", False
    if run.status == Status.FAILED:
        name = f"#{item.number}" if run.manifest["bad_input"] is not None else name
        return f"error: {name}: {run.manifest['cause']}", True
    ended = f"{run.ending}, {run.manifest['wall_seconds']:.2f} s"
    notes = ended, describe_drift(run), describe_idle(run)
    return f"{name}: {'; '.join(filter(None, notes))}", False
