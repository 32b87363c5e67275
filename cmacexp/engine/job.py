"""One of many runs, of a sweep or of a study, in whatever process: found if it is finished, else run."""

import pickle
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import JobRuntime, run_job, setup_globals
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf, open_dict, read_write

from cmacexp.config import Config, to_config
from cmacexp.config.compose import PlainConfig, make_record, set_values
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import HYDRA_FOLDER
from cmacexp.data.folder import RUN_KEY, new_result
from cmacexp.data.integrity import is_finished
from cmacexp.data.run import Run
from cmacexp.engine.failure import make_failure
from cmacexp.engine.objective import check_metric
from cmacexp.engine.pool import is_first_worker, report_share
from cmacexp.engine.run import run_scenario
from cmacexp.engine.sweep_tables import select_run_overrides
from cmacexp.errors import BadInput
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.loop.scenario import make_scenario
from cmacexp.terminal.messages import announce_compiling, describe_drift, describe_idle, format_outcome
from cmacexp.terminal.output import print_line
from cmacexp.typing import Status


class JobEnd(NamedTuple):
    """How a job of a sweep ended, and the line that says it."""

    run: Run
    """With its metrics and their summary, which are not read again."""
    text: str
    is_error: bool


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
        run = Run(folder)
        if overrides not in (None, run.manifest.get("overrides")):  # the same config by other words
            run.manifest["overrides"] = overrides
            manifests.write(folder, run.manifest)
        return run, False
    if is_first_worker():
        announce_compiling()
    expect_runs(runs)

    def watch(cycles: float) -> None:
        report_share(cycles / config.cycles)

    options: dict[str, Any] = {"record": record, "overrides": overrides, "durable": overrides is None}
    return run_scenario(config, folder, watch, make_scenario(config), **options), True


def write_failure(
    folder: Path,
    composed: DictConfig | dict[str, Any],
    error: Exception,
    record: Mapping[str, str] | None = None,
    **entries: Any,
) -> Run:
    """Leave a manifest, with further ``entries``, that says why a config gave no run; an earlier run stays."""
    manifest, written = make_failure(composed, error, **entries), folder / manifests.MANIFEST
    with suppress(OSError, BadInput):  # then only the terminal and the table show it
        if not (written.exists() and manifests.read_file(written)["files"]):
            with new_result(folder, RUN_KEY) as writer:
                for name, text in (record or {}).items():
                    writer.write_text(f"{HYDRA_FOLDER}/{name}", text)
                manifests.write(writer.part, manifest)
    return Run(folder, manifest)


@lru_cache(8)
def _unpack(packed: bytes) -> tuple[DictConfig, Any, Path, PlainConfig | None]:
    """What was packed; at the end the config as plain values, None where a job needs Hydra to run it."""
    composed, callbacks, folder, needs_hydra = pickle.loads(packed)
    plain: Any = None if needs_hydra else OmegaConf.to_container(composed, enum_to_str=True)
    return composed, callbacks, folder, plain and PlainConfig(plain)


def _describe_job(hydra: Any, overrides: list[str], number: int, folder: Path) -> None:
    """Set what Hydra says of a job in its part of a config, plain or not."""
    job, how = hydra["job"], hydra["job"]["config"]["override_dirname"]
    named = sorted(text for text in overrides if text.partition("=")[0] not in how["exclude_keys"])
    job["override_dirname"] = how["item_sep"].join(named).replace("=", how["kv_sep"])
    hydra["overrides"]["task"], job["id"], job["num"] = overrides, str(number), number
    hydra["runtime"]["output_dir"] = str(folder / str(number))


def run_packed(packed: bytes, overrides: list[str], values: list[str], number: int, jobs: int) -> JobEnd:
    """Run one of so many jobs of a sweep in this process.

    ``packed`` is what Hydra composed for a job of the same keys and options. The ``values`` of this one are set in
    it, all of them, since it holds those of the last one.
    """
    composed, callbacks, folder, plain = _unpack(packed)
    if plain and (config := plain.set_numbers(values)) is not None:
        _describe_job(config["hydra"], overrides, number, folder)
        return _run_job(config, config.pop("hydra"), jobs)
    with read_write(composed.hydra), open_dict(composed.hydra):
        set_values(composed, values)
        _describe_job(composed.hydra, overrides, number, folder)
    if plain:
        unresolved: Any = OmegaConf.to_container(composed, enum_to_str=True)
        return _run_job(unresolved, unresolved.pop("hydra"), jobs)
    setup_globals()
    JobRuntime.instance().set("name", composed.hydra.job.name)
    returned = run_job(
        hydra_context=HydraContext(None, callbacks),  # type: ignore[arg-type]  # no job composes anything
        task_function=lambda task: _run_job(task, OmegaConf.to_container(HydraConfig.get(), enum_to_str=True), jobs),  # type: ignore[call-overload]
        config=composed,
        job_dir_key="hydra.sweep.dir",
        job_subdir_key="hydra.sweep.subdir",
    )
    ended: JobEnd = returned.return_value
    return ended


def _run_job(composed: DictConfig | dict[str, Any], hydra: Any, jobs: int) -> JobEnd:
    """Run one of so many jobs; a failure is left on disk and does not end the sweep."""
    number, overrides = hydra["job"]["num"], select_run_overrides(hydra["overrides"]["task"])
    folder, name = Path(hydra["runtime"]["output_dir"]), f"#{number} {' '.join(overrides)}"
    try:
        config = to_config(composed)
        check_metric(config.optimize, config.machine.kind)
        record = make_record(composed, hydra) if config.record.trace else None
        run, is_new = ensure_run(config, folder, jobs, config.sweep.resume, record, overrides)
    except Exception as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        run = write_failure(folder, composed, error, make_record(composed, hydra), overrides=overrides)
        return JobEnd(run, f"error: #{number}: {run.manifest['cause']}", True)
    _ = run.outcome
    if not is_new:
        return JobEnd(run, f"{name}: finished before, not run again", False)
    if run.status == Status.FAILED:
        return JobEnd(run, f"error: {name}: {run.manifest['cause']}", True)
    notes = format_outcome(run), describe_drift(run), describe_idle(run)
    text = f"{name}: {'; '.join(filter(None, notes))}"
    if run.status == Status.INTERRUPTED:
        print_line(text)
        raise KeyboardInterrupt
    return JobEnd(run, text, False)
