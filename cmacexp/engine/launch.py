"""The jobs of a sweep on all cores: a process imports once, and a kind of job is composed once."""

import pickle
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.utils import JobReturn, JobRuntime, JobStatus, run_job, setup_globals
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf, open_dict

from cmacexp.config.compose import parse_override, set_values
from cmacexp.engine.sweep import Kind, get_sweep

if TYPE_CHECKING:
    from cmacexp.engine.sweep_job import Job


def launch(launcher: Any, batch: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
    """Run the jobs of a batch of a sweep, whose first has the number ``first``; what they return, in their order."""
    items = make_items(launcher, batch, first)
    return [make_return(*ended) for ended in get_sweep().start_workers()(run_packed, items, first)]


def make_items(launcher: Any, batch: Sequence[Sequence[str]], first: int) -> list[tuple[Any, ...]]:
    """The arguments of :func:`run_packed` for each job of a batch."""
    sweep, packed, items = get_sweep(), dict[int, bytes](), []
    jobs = max(sweep.planned.total(), len(batch))
    for number, overrides in enumerate(batch, first):
        kind = sweep.get_kind(launcher, overrides)
        if id(kind) not in packed:
            packed[id(kind)] = _pack(kind, sweep.folder.absolute(), launcher.hydra_context.callbacks)
        changed = [new for new, old in zip(overrides, kind.first, strict=True) if new != old]
        items.append((packed[id(kind)], list(overrides), changed, number, jobs))
    return items


def make_return(value: Any, status: JobStatus) -> JobReturn:
    """What a launcher gives Hydra for a job."""
    returned = JobReturn(status=status)
    returned.return_value = value
    return returned


def _pack(kind: Kind, folder: Path, callbacks: Any) -> bytes:
    """What a worker has to know of a kind of jobs: plain values where it needs no help of Hydra and OmegaConf."""
    config: Any = OmegaConf.to_container(kind.composed, enum_to_str=True)
    hydra = config.pop("hydra")
    job, where = hydra["job"], hydra["sweep"]["subdir"]
    asked = job["chdir"], job["env_set"], hydra["output_subdir"], hydra["job_logging"]["root"]
    is_default = where == "${hydra.job.num}" and len(hydra["callbacks"]) == 1 and not any(asked)
    # Only OmegaConf understands interpolations, and values that are missing.
    is_plain = is_default and not any(text in str((config, kind.runs)) for text in ("${", "???"))
    return pickle.dumps((config, hydra, folder) if is_plain else (kind.composed, callbacks, folder))


def run_packed(
    kind: bytes, overrides: list[str], changed: list[str], number: int, jobs: int
) -> tuple[Any, JobStatus]:
    """Run one of so many jobs of a sweep in this process.

    ``changed`` are the overrides that the first job of its kind does not have.
    """
    from cmacexp.engine.sweep_job import run_job as run_here

    job, callbacks = unpack(kind, overrides, changed, number)
    if callbacks is None:
        return run_here(job, jobs), JobStatus.COMPLETED
    return _run_by_hydra(job.config, callbacks, jobs)


def unpack(kind: bytes, overrides: list[str], changed: list[str], number: int) -> "tuple[Job, Any]":
    """A job of a sweep, and Hydra's callbacks if they are to be called; arguments as those of :func:`run_packed`.

    A config that only OmegaConf understands has that of Hydra within it.
    """
    from cmacexp.engine.sweep_job import Job

    config, rest, folder = pickle.loads(kind)
    hydra, callbacks = rest, None
    if isinstance(config, DictConfig):
        hydra, callbacks = config.hydra, rest
        set_values(config, changed)
    else:
        for override in map(parse_override, changed):
            set_value(config, override.key_or_group.split("."), override.value())
    how = hydra["job"]["config"]["override_dirname"]
    named = sorted(text for text in overrides if text.partition("=")[0] not in how["exclude_keys"])
    with open_dict(hydra) if callbacks else nullcontext():
        hydra["overrides"]["task"] = overrides
        hydra["job"]["override_dirname"] = how["item_sep"].join(named).replace("=", how["kv_sep"])
        hydra["job"]["id"], hydra["job"]["num"] = str(number), number
        path = folder / str(number if callbacks is None else hydra["sweep"]["subdir"])
        hydra["runtime"]["output_dir"] = str(path)
    return Job(number, path, config, hydra), callbacks


def set_value(config: Any, key: list[str], value: Any) -> None:
    """Set a value, as OmegaConf does: of an object that replaces another one, entry by entry."""
    place = int(key[0]) if isinstance(config, list) else key[0]
    if len(key) > 1:
        set_value(config[place], key[1:], value)
    elif isinstance(value, dict) and isinstance(config[place], dict):
        for name, entry in value.items():
            set_value(config[place], [name], entry)
    else:
        config[place] = value


def _run_by_hydra(composed: Any, callbacks: Any, jobs: int) -> tuple[Any, JobStatus]:
    """Run a job whose config only Hydra and OmegaConf understand; Hydra copies it four times."""
    from cmacexp.engine.sweep_job import run_hydra_job

    setup_globals()
    JobRuntime.instance().set("name", composed.hydra.job.name)
    returned = run_job(
        hydra_context=HydraContext(None, callbacks),  # type: ignore[arg-type]  # no job composes anything
        task_function=lambda task: run_hydra_job(task, jobs),
        config=composed,
        job_dir_key="hydra.sweep.dir",
        job_subdir_key="hydra.sweep.subdir",
    )
    return returned._return_value, returned.status
