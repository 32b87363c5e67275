"""One job of a sweep, in whatever process: it prints a line, and leaves on disk how it ended."""

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from cmacexp.config import to_config
from cmacexp.config.compose import make_record
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import HYDRA_FOLDER
from cmacexp.data.files import FAILED
from cmacexp.data.folder import RUN_KEY, check_place, new_result, write_atomically
from cmacexp.data.tables import TRACE_FILE
from cmacexp.engine.failure import describe_failure, make_failure
from cmacexp.engine.pool import FAILED_SHARE, share_progress
from cmacexp.engine.sweep import Sweep, select_run_overrides
from cmacexp.errors import BadInput
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import interrupt_held_back, is_interrupt


class Job(NamedTuple):
    """A job of a sweep, composed."""

    number: int
    folder: Path
    config: DictConfig | dict[str, Any]
    hydra: dict[str, Any]
    """Hydra's own config."""


def run_hydra_job(composed: DictConfig, jobs: float | None = None) -> float | None:
    """:func:`run_job` for a job that Hydra has composed and begun; None: it is one of as many as the sweep has."""
    hydra: Any = HydraConfig.get()
    plain: Any = OmegaConf.to_container(hydra, enum_to_str=True)  # overrides as typed: some name other values
    if jobs is None:  # a process of another launcher cannot know
        jobs = math.inf if Sweep.current is None else Sweep.current.planned.total()
    return run_job(Job(hydra.job.num, Path(hydra.runtime.output_dir), composed, plain), jobs)


def run_job(job: Job, jobs: float) -> float | None:
    """Run one of so many jobs of a sweep; a failure is left on disk and does not end the sweep.

    Returns what ``optimize`` asks for, see :func:`cmacexp.engine.objective.read_objective`.
    """
    number, folder, composed, hydra = job
    metric, report = composed.get("optimize"), share_progress(number)
    with interrupt_held_back():  # some libraries cannot be imported partially
        from cmacexp.data.integrity import is_finished
        from cmacexp.data.run import Run
        from cmacexp.engine.objective import check_metric, find_direction, read_objective
        from cmacexp.engine.run import run_scenario
        from cmacexp.loop.scenario import make_scenario
        from cmacexp.terminal.messages import announce_compiling, describe_drift, describe_idle, format_outcome
        from cmacexp.terminal.output import print_line

    announce_compiling()
    expect_runs(jobs)
    overrides = select_run_overrides(hydra["overrides"]["task"])
    summary, result, name = None, None, f"#{number} {' '.join(overrides)}"
    try:
        config = to_config(composed)
        check_metric(config.optimize, config.machine.kind)
        check_place(folder, RUN_KEY)
        if not (config.sweep.resume and is_finished(folder, config)):
            scenario, cycles = make_scenario(config), config.cycles
            result = run_scenario(
                *(config, folder, lambda done: report(done / cycles), scenario),
                record=make_record(composed, hydra) if config.record.trace else None,
                overrides=overrides,
            )
        elif (manifest := manifests.read(folder)).get("overrides") != overrides:  # the same config by other words
            manifests.write(folder, {**manifest, "overrides": overrides})
    except Exception as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        cause = describe_failure(error)
        summary = Run(folder, {"status": "failed", "cause": cause, "files": {}})
        _write_failure(job, overrides, error)
        print_line(f"error: #{number}: {cause}", error=True)
    else:
        if result is None:
            print_line(f"{name}: finished before, not run again")
        elif result.status == "failed":
            print_line(f"error: {name}: {result.manifest['cause']}", error=True)
        else:
            notes = (f"{name}: {format_outcome(result)}", describe_drift(result), describe_idle(result))
            print_line("; ".join(filter(None, notes)))
        if result is not None and result.status == "interrupted":
            raise KeyboardInterrupt
    report(1.0 if summary is None else FAILED_SHARE)
    if metric is None:
        return None
    direction = find_direction(metric, hydra["sweeper"].get("direction"), searches=False)
    return read_objective(metric, summary or Run(folder), direction)


def _write_failure(job: Job, overrides: list[str], error: Exception) -> None:
    """Leave a manifest that names why there is no result; an earlier run in the folder stays, with it beside."""
    manifest = make_failure(job.config, error, overrides=overrides)
    with suppress(OSError, BadInput):  # then the job counts as unfinished, and the terminal shows its cause
        if (job.folder / TRACE_FILE).exists():
            with write_atomically(job.folder / FAILED) as temporary:
                temporary.write_text(json.dumps(manifest), encoding="utf-8")
            return
        with new_result(job.folder, RUN_KEY) as writer:
            for name, text in make_record(job.config, job.hydra).items():
                writer.write_text(f"{HYDRA_FOLDER}/{name}", text)
            manifests.write(writer.part, manifest)
