"""The jobs of a sweep on all cores: a process imports once, and a kind of job is composed once."""

import pickle
from collections.abc import Sequence
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.utils import JobReturn, JobRuntime, JobStatus, run_job, setup_globals
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf, open_dict

from cmacexp.errors import BadInput
from cmacexp.experiment.sweep_start import SweepStart


def launch(launcher: Any, batch: Sequence[Sequence[str]], first: int, processes: int | None) -> list[JobReturn]:
    """Run the jobs of a batch of a sweep.

    Args:
        launcher: that Hydra has set up.
        batch: overrides of each job.
        first: number of the first.
        processes: as of ``hydra/launcher=cores``.

    Returns:
        What they return, in their order.
    """
    sweep = SweepStart.sweep
    if sweep is None:
        raise RuntimeError("hydra/launcher=cores is for python -m cmacexp -m; choose hydra/launcher=basic")
    if processes is not None and processes < 1:
        raise BadInput("hydra.launcher.processes", processes, "must be at least 1, or null: one for each core")
    packed: dict[int, bytes] = {}
    items = []
    for number, overrides in enumerate(batch, first):
        kind = sweep.get_kind(launcher, overrides)
        if id(kind) not in packed:
            packed[id(kind)] = pickle.dumps((kind.composed, launcher.hydra_context.callbacks))
        changed = [new for new, old in zip(overrides, kind.first, strict=True) if new != old]
        items.append((packed[id(kind)], list(overrides), changed, number, max(sweep.planned.total(), len(batch))))
    return [_make_return(*ended) for ended in sweep.start_workers(processes)(_run, items, first)]


def _make_return(value: Any, status: JobStatus) -> JobReturn:
    returned = JobReturn(status=status)
    returned.return_value = value
    return returned


def _set_values(config: DictConfig, overrides: list[str], changed: list[str], number: int) -> None:
    """Set what a job overrides in the config of the first of its kind, as Hydra does once options are chosen."""
    for override in OverridesParser.create().parse_overrides(changed):
        OmegaConf.update(config, override.key_or_group, override.value(), merge=True)
    how = config.hydra.job.config.override_dirname
    named = sorted(text for text in overrides if text.partition("=")[0] not in how.exclude_keys)
    with open_dict(config):
        config.hydra.overrides.task = overrides
        config.hydra.job.override_dirname = how.item_sep.join(named).replace("=", how.kv_sep)
        config.hydra.job.id = config.hydra.job.num = number


def _run(kind: bytes, overrides: list[str], changed: list[str], number: int, jobs: int) -> tuple[Any, JobStatus]:
    """Run one of so many jobs in this process."""
    from cmacexp.experiment.sweep_job import run_job as run_in_folder

    setup_globals()
    config, callbacks = pickle.loads(kind)
    _set_values(config, overrides, changed, number)
    JobRuntime.instance().set("name", config.hydra.job.name)
    returned = run_job(
        hydra_context=HydraContext(None, callbacks),  # type: ignore[arg-type]  # no job composes anything
        task_function=lambda composed: run_in_folder(composed, jobs),
        config=config,
        job_dir_key="hydra.sweep.dir",
        job_subdir_key="hydra.sweep.subdir",
    )
    return returned._return_value, returned.status
