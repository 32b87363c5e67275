"""One of many runs, of a sweep or of a study, in whatever process: found if it is finished, else run."""

import json
import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import setup_globals
from omegaconf import DictConfig, OmegaConf, open_dict

from cmacexp.config import Config, config_hash, to_config, to_plain
from cmacexp.config.component import COMPONENTS
from cmacexp.config.compose import find_referred, make_record, set_numbers, set_values
from cmacexp.data import manifest as manifests
from cmacexp.data.folder import RUN_KEY, new_result
from cmacexp.data.integrity import compute_hashes, is_finished
from cmacexp.data.run import Run
from cmacexp.engine.chunk import Chunk
from cmacexp.engine.equal_results import describe_result
from cmacexp.engine.job_store import FINGERPRINT, HASHES, JobItem, JobTables, find_fingerprint, write_part
from cmacexp.engine.objective import check_metric
from cmacexp.engine.run import describe_run, run_scenario
from cmacexp.engine.sweep_tables import concat_metrics, make_column, make_table, read_metrics, select_run_overrides
from cmacexp.errors import BadComponent, BadInput, CmacexpError, describe_failure, format_user_traceback
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.loop import End
from cmacexp.loop.scenario import Scenario
from cmacexp.metrics.drift import make_drift_entry
from cmacexp.metrics.registry import make_rows
from cmacexp.terminal.messages import describe_drift, describe_idle, format_outcome
from cmacexp.typing import Status


def ensure_run(
    config: Config,
    folder: Path,
    runs: int,
    reuse: bool = True,
    record: Mapping[str, str] | None = None,
    overrides: list[str] | None = None,
) -> tuple[Run, bool]:
    """The run of a config, one of so many, and whether it was run now.

    It was not if ``folder`` holds it already, and it is to ``reuse``. ``record`` and ``overrides`` as in
    :func:`cmacexp.engine.run.run_scenario`, which says too what is raised.
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
    """The config as :func:`set_numbers` takes it; pickled if a component is custom, so that each job has its own."""
    typed: Any
    """The typed config, in the same way; None if it is wrong, or ``referred`` is None."""
    referred: frozenset[str] | None
    """Keys from which other values follow, see :func:`find_referred`."""


@lru_cache(8)
def _unpack(packed: bytes) -> JobTemplate:
    setup_globals()
    composed, typed = pickle.loads(packed), None
    plain: Any = OmegaConf.to_container(composed, enum_to_str=True)
    hydra = plain.pop("hydra")
    with open_dict(composed):
        del composed["hydra"]
    referred = find_referred(composed)
    with suppress(Exception):  # which each job reports
        typed = None if referred is None else to_config(composed)
    modules = [type(getattr(typed, group, None)).__module__ for group in COMPONENTS]
    if typed is None or all(name.startswith("cmacexp.") for name in modules):
        return JobTemplate(composed, hydra, plain, typed, referred)
    return JobTemplate(composed, hydra, pickle.dumps(plain), pickle.dumps(typed), referred)


def _describe_job(hydra: Any, item: JobItem, folder: Path) -> None:
    """Set what Hydra says of a job in its part of a config."""
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
    template, by_number = _unpack(packed), {item.number: item for item in items}
    chunk, waiting, began = Chunk(), dict[int, Config](), time.perf_counter()
    ended = dict[int, tuple[Run | None, bool]]()
    """Runs by the numbers of their jobs, None where the tables have the result, and whether they were made now."""
    expect_runs(jobs)
    # In a row, as run_chunk does.
    typed, referred = template.typed, template.referred or frozenset()
    configs = [set_numbers(typed, item.values, referred) if typed else None for item in items]

    def settle(item: JobItem, do: Callable[[], tuple[Run | None, bool] | Config]) -> None:
        """Note how a job ends, or that it waits for others; a failure is left on disk and does not end the sweep."""
        try:
            found = do()
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            composed, overrides = _compose(template, root, item), select_run_overrides(item.overrides)
            record = make_record(composed, template.hydra)
            found = write_failure(root / item.folder, composed, error, record, overrides=overrides), True
        if isinstance(found, Config):
            waiting[item.number] = found
            return
        ended[item.number] = run, _ = found
        if run is not None and run.status == Status.INTERRUPTED:
            raise KeyboardInterrupt

    def run_with_others(item: JobItem, do: Callable[[], tuple[Scenario, End]]) -> tuple[Run, bool]:
        manifest = describe_run(*do()) | {"overrides": select_run_overrides(item.overrides)}
        return Run(root / item.folder, manifest), True

    try:
        for item, config in zip(items, configs, strict=True):
            settle(item, partial(_run_item, template, root, item, jobs, config))
        for number, do in chunk.list_runs(waiting):
            settle(by_number[number], partial(run_with_others, by_number[number], do))
    finally:
        made = {number: run for number in by_number if (run := ended.get(number, (None,))[0]) is not None}
        seconds, scored = time.perf_counter() - began, chunk.score()
        loops = {number: made[number].manifest["rollout_seconds"] for number in scored if number in made}
        rest = max(0.0, seconds - sum(loops.values())) / max(1, len(loops))
        for number, scores in scored.items():
            if run := made.get(number):  # it has no folder
                run.is_checked, run.scores = False, scores
                run.manifest |= {"drift": make_drift_entry(scores.legs), "files": chunk.hashes[number]}
                run.manifest["wall_seconds"] = loops[number] + rest
        if made:
            write_part(root, sweep, _tabulate(root, made, {item.number: item.overrides for item in items}))
    return [_describe_end(item, *ended[item.number]) for item in items]


def _compose(template: JobTemplate, root: Path, item: JobItem) -> DictConfig:
    """What Hydra composes for a job; the template has it, and what Hydra says of the job, until the next one."""
    _describe_job(template.hydra, item, root / item.folder)
    composed = template.composed
    set_values(composed, item.values)
    if template.referred is None:  # perhaps it is ${hydra:...} that values follow from
        own: Any = OmegaConf.to_container(composed)
        vars(HydraConfig.instance())["cfg"] = OmegaConf.create({**own, "hydra": template.hydra})
    return composed


def _run_item(
    template: JobTemplate, root: Path, item: JobItem, jobs: int, config: Config | None
) -> tuple[Run | None, bool] | Config:
    """The run of one of so many jobs, of this config if it is known already, and whether it was run now.

    None if the tables have its result. Of a run that keeps metrics alone, and is yet to be made, the config.
    """
    folder, composed = root / item.folder, None
    if config is None:
        config = to_config(composed := _compose(template, root, item))
    check_metric(config.optimize, config.machine.kind)
    if config.record.trace or config.record.weights:
        _describe_job(template.hydra, item, folder)
        composed = composed or set_numbers(template.plain, item.values) or _compose(template, root, item)
        record = make_record(composed, template.hydra) if config.record.trace else None
        return ensure_run(config, folder, jobs, config.sweep.resume, record, select_run_overrides(item.overrides))
    if item.known and item.known == (
        config_hash(to_plain(config)),
        *map(str, compute_hashes(config).values()),
    ):
        return None, False
    if config.sweep.resume and is_finished(folder, config):
        return Run(folder), False
    return config


def _tabulate(root: Path, runs: Mapping[int, Run], overrides: Mapping[int, list[str]]) -> JobTables:
    """The tables of jobs by their numbers."""
    rows = []
    for (number, run), shown in zip(runs.items(), make_rows([*runs.values()], ()), strict=True):
        rows.append(
            {
                "run": number,
                "folder": run.folder.relative_to(root).as_posix(),
                "overrides": " ".join(select_run_overrides(overrides[number])),
                **shown,
                **{name: str(run.manifest[name]) for name in HASHES},
                "result": describe_result(run),
                "bad_input": bool(run.manifest["bad_input"]),
                FINGERPRINT: find_fingerprint(run.folder) if run.is_checked else "",
                "manifest": json.dumps(run.manifest),
            }
        )
    metrics, index = concat_metrics([read_metrics(run) for run in runs.values()])
    numbers = make_column([rows[place]["run"] for place in index])
    return JobTables(make_table(rows), metrics.add_column(0, "run", numbers))


def _describe_end(item: JobItem, run: Run | None, is_new: bool) -> tuple[str, bool]:
    """How a job ended, in a line, and whether that is an error."""
    name = f"#{item.number} {' '.join(select_run_overrides(item.overrides))}"
    if run is None or not is_new:
        return f"{name}: finished before, not run again", False
    if run.status == Status.FAILED:
        name = f"#{item.number}" if run.manifest["bad_input"] is not None else name
        return f"error: {name}: {run.manifest['cause']}", True
    notes = format_outcome(run), describe_drift(run), describe_idle(run)
    return f"{name}: {'; '.join(filter(None, notes))}", False
