"""The jobs of a sweep on all cores: a process imports once, and a kind of job is composed once."""

import pickle
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.utils import JobReturn, JobRuntime, JobStatus, run_job, setup_globals
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf, open_dict

from cmacexp.config.compose import parse_override, set_values
from cmacexp.errors import BadInput
from cmacexp.experiment.sweep_start import Kind, SweepStart


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
            packed[id(kind)] = _pack(kind, sweep.folder.absolute(), launcher.hydra_context.callbacks)
        changed = [new for new, old in zip(overrides, kind.first, strict=True) if new != old]
        items.append((packed[id(kind)], list(overrides), changed, number, max(sweep.planned.total(), len(batch))))
    return [_make_return(*ended) for ended in sweep.start_workers(processes)(run_packed, items, first)]


def _make_return(value: Any, status: JobStatus) -> JobReturn:
    returned = JobReturn(status=status)
    returned.return_value = value
    return returned


SPECIAL = ("${", "???")
"""What only OmegaConf understands: interpolations, and values that are missing."""


def _pack(kind: Kind, folder: Path, callbacks: Any) -> bytes:
    """What a worker has to know of a kind of jobs: plain values where it needs no help of Hydra and OmegaConf."""
    config: Any = OmegaConf.to_container(kind.composed, enum_to_str=True)
    hydra = config.pop("hydra")
    job, where = hydra["job"], hydra["sweep"]["subdir"]
    asked = job["chdir"], job["env_set"], hydra["output_subdir"], hydra["job_logging"]["root"]
    is_default = where == "${hydra.job.num}" and len(hydra["callbacks"]) == 1 and not any(asked)
    is_plain = is_default and not any(text in str((config, kind.runs)) for text in SPECIAL)
    return pickle.dumps((config, hydra, folder) if is_plain else (kind.composed, callbacks))


def run_packed(
    kind: bytes, overrides: list[str], changed: list[str], number: int, jobs: int
) -> tuple[Any, JobStatus]:
    """Run one of so many jobs of a sweep in this process.

    Args:
        kind: of the job, packed.
        overrides: of the job.
        changed: those that the first job of its kind does not have.
        number: of the job.
        jobs: of the sweep.
    """
    from cmacexp.experiment.sweep_job import Job
    from cmacexp.experiment.sweep_job import run_job as run_here

    config, rest, *more = pickle.loads(kind)
    if isinstance(config, DictConfig):
        return _run_by_hydra(config, rest, overrides, changed, number, jobs)
    hydra, (folder,) = rest, more
    for override in map(parse_override, changed):
        _set(config, override.key_or_group.split("."), override.value())
    hydra["overrides"]["task"] = overrides
    hydra["runtime"]["output_dir"] = str(folder / str(number))
    hydra["job"] |= {"override_dirname": _name(hydra, overrides), "id": str(number), "num": number}
    return run_here(Job(number, folder / str(number), config, hydra), jobs), JobStatus.COMPLETED


def _set(config: dict[str, Any], key: list[str], value: Any) -> None:
    """Set a value, as OmegaConf does: of an object that replaces another one, entry by entry."""
    for name in key[:-1]:
        config = config[name]
    if isinstance(value, dict) and isinstance(config[key[-1]], dict):
        for name, entry in value.items():
            _set(config, [*key[-1:], name], entry)
    else:
        config[key[-1]] = value


def _name(hydra: Mapping[str, Any], overrides: list[str]) -> str:
    """Hydra's name for a job of these overrides."""
    how = hydra["job"]["config"]["override_dirname"]
    named = sorted(text for text in overrides if text.partition("=")[0] not in how["exclude_keys"])
    return str(how["item_sep"].join(named).replace("=", how["kv_sep"]))


def _run_by_hydra(
    composed: DictConfig, callbacks: Any, overrides: list[str], changed: list[str], number: int, jobs: int
) -> tuple[Any, JobStatus]:
    """:func:`run_packed` of a config that only Hydra and OmegaConf understand; Hydra copies it four times."""
    from cmacexp.experiment.sweep_job import run_hydra_job

    setup_globals()
    set_values(composed, changed)
    with open_dict(composed):
        composed.hydra.overrides.task = overrides
        composed.hydra.job.override_dirname = _name(composed.hydra, overrides)
        composed.hydra.job.id, composed.hydra.job.num = str(number), number
    JobRuntime.instance().set("name", composed.hydra.job.name)
    returned = run_job(
        hydra_context=HydraContext(None, callbacks),  # type: ignore[arg-type]  # no job composes anything
        task_function=lambda task: run_hydra_job(task, jobs),
        config=composed,
        job_dir_key="hydra.sweep.dir",
        job_subdir_key="hydra.sweep.subdir",
    )
    return returned._return_value, returned.status
