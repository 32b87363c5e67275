"""``sweep.dry_run=true``: the jobs of a sweep, whether they can run, and what they take; nothing is run."""

from collections.abc import Sequence
from typing import Any

from omegaconf import DictConfig, OmegaConf

from cmacexp.config import Config, to_config, to_plain
from cmacexp.errors import CmacexpError
from cmacexp.experiment.launch import make_items, unpack
from cmacexp.experiment.sweep import Sweep, select_run_overrides
from cmacexp.experiment.workers import count_cores
from cmacexp.jit.compiler import expect_runs
from cmacexp.report.terminal import format_duration, say

JOB_SECONDS, STEP_SECONDS, OTHER_STEP_SECONDS = 0.02, 1.5e-6, 6e-6
"""Processor time of a job, and of a step of one leg: of the analytic plant, of others; ``docs/performance.md``."""
JOB_BYTES, ROW_BYTES = 60_000, 100
"""On disk, of a job, and of a row of its trace."""
Checked = tuple[str | None, float, float]
"""Of a job that was not run: why it could not run, seconds of a processor, bytes."""


def _check(kind: bytes, overrides: list[str], changed: list[str], number: int, jobs: int) -> Checked:
    """Check a job; arguments as those of :func:`cmacexp.experiment.launch.run_packed`."""
    from cmacexp.data.integrity import is_finished
    from cmacexp.experiment.objective import check_metric
    from cmacexp.loop.scenario import make_scenario

    expect_runs(jobs)
    job, _ = unpack(kind, overrides, changed, number)
    composed = job.config
    if isinstance(composed, DictConfig):
        composed = OmegaConf.masked_copy(composed, [str(key) for key in composed if key != "hydra"])
    try:
        config = to_config(composed)
        check_metric(config.optimize, config.machine.kind)
        if config.sweep.resume and is_finished(job.folder, config):
            return None, 0.0, 0.0
        make_scenario(config)
    except (CmacexpError, OSError) as error:
        return " ".join(str(error).split()), 0.0, 0.0
    return None, *_estimate(config)


def _estimate(config: Config) -> tuple[float, float]:
    """Processor time of a run, s, and its bytes on disk, if it keeps all steps or none."""
    steps = config.cycles * config.steps_per_cycle * config.legs
    is_quick = str(to_plain(config)["plant"]["_target_"]).endswith("AnalyticPlant")
    seconds = JOB_SECONDS + steps * (STEP_SECONDS if is_quick else OTHER_STEP_SECONDS)
    return seconds, JOB_BYTES + ROW_BYTES * steps * config.record.trace


class DryRun:
    """A launcher of Hydra that runs nothing.

    Args:
        launcher: that would run the jobs.
        sweep: of the jobs; is given what was found, for :func:`finish_dry_run`.
    """

    def __init__(self, launcher: Any, sweep: Sweep):
        self.launcher, self.sweep = launcher, sweep

    def launch(self, batch: Sequence[Sequence[str]], initial_job_idx: int) -> list[Any]:
        """List and check the next jobs."""
        items = make_items(self.launcher, batch, initial_job_idx)
        checked = self.sweep.start_workers()(_check, items, initial_job_idx)
        for number, (overrides, (error, _, _)) in enumerate(zip(batch, checked, strict=True), initial_job_idx):
            say(f"#{number} {' '.join(select_run_overrides(overrides))}")
            if error is not None:
                say(f"error: #{number}: {error}", error=True)
        self.sweep.checked += checked
        return []


def finish_dry_run(sweep: Sweep) -> str:
    """Print what all jobs would take; how the sweep would end, at best."""
    errors, seconds, size = zip(*sweep.checked, strict=True)
    refused, cores = sum(error is not None for error in errors), sweep.processes or count_cores()
    time = format_duration(sum(seconds) / cores)
    say(f"{len(errors)} jobs, {refused} of them cannot run; nothing was run")
    say(f"about {time} on {cores} cores, {sum(size) / 1e6:.3g} MB in {sweep.folder}")
    return "bad input" if refused == len(errors) else "failed" if refused else "completed"
