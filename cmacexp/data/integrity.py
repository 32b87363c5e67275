"""Whether a run on disk is complete, unchanged, and the result of a given config."""

from contextlib import suppress
from pathlib import Path
from typing import get_args

from cmacexp.config import Config, config_hash, to_plain
from cmacexp.config.component import custom_code_hash
from cmacexp.config.machine import MACHINES, BodyMachine, RobotMachine, read_model
from cmacexp.data import manifest as manifests
from cmacexp.data.tables import (
    BODY_FILE,
    BODY_METRICS_FILE,
    METRICS_CSV,
    METRICS_FILE,
    RECORDING_FILE,
    TRACE_FILE,
    WEIGHTS,
)
from cmacexp.errors import BadRun
from cmacexp.jit.sources import code_hash
from cmacexp.typing import RESULTS

VIEWS = (METRICS_CSV, RECORDING_FILE)
"""Files that can be made from the others: manifests of earlier versions list them."""


def compute_hashes(config: Config, *components: object) -> dict[str, str | None]:
    """Entries of the manifest: hashes of what a result depends on besides its config.

    They are of the code, that of custom components, whether made or named by the config, the weights that the run
    starts from, unless they are gone, and the model of a robot.
    """
    machine, start = config.machine, config.learning.start_from
    weights = Path(start) / WEIGHTS if start is not None else None
    return {
        "code_hash": code_hash(),
        "custom_code": custom_code_hash(config, *components),
        "start_weights": manifests.current_hash(weights) if weights and weights.is_file() else None,
        "model_hash": read_model(machine).model_hash if isinstance(machine, RobotMachine) else None,
    }


def is_finished(folder: Path, config: Config) -> bool:
    """Whether ``folder`` holds the whole result of ``config``, made by the code as it is now.

    A run is finished if its manifest has the status of a result and the same hashes of config and code, every file
    that it lists exists unchanged, its traces have the requested rows, its weights are stored if requested, and
    neither the weights that it started from, nor a robot's model, nor the code of custom components have changed.
    """
    try:
        manifest = manifests.read(folder)
    except BadRun:
        return False
    plain, kept = to_plain(config), manifest["config"].get("record", {})
    same = manifest["config_hash"] == config_hash(plain)
    same = same and all(manifest[name] == value for name, value in compute_hashes(config).items())
    as_thin = all(kept.get(key) == plain["record"][key] for key in ("every_nth_step", "cycles"))
    has_trace = (TRACE_FILE in manifest["files"] and as_thin) or not config.record.trace
    has_weights = WEIGHTS in manifest["files"] or not config.record.weights
    return same and has_trace and has_weights and manifest["status"] in RESULTS and not list_faults(folder, manifest)


def _list_missing(manifest: manifests.Manifest) -> list[str]:
    """Files that a run with a result must have, and that its manifest does not list; a sweep must have none."""
    if "kind" in manifest or manifest["status"] not in RESULTS:
        return []
    walks = MACHINES.get(manifest["config"]["machine"]["kind"]) in get_args(BodyMachine)
    names = [METRICS_FILE, BODY_METRICS_FILE] if walks else [METRICS_FILE]
    if manifest["config"].get("record", {}).get("trace", True):
        names += [TRACE_FILE, BODY_FILE] if walks else [TRACE_FILE]
    return [f"{name}: not listed in {manifests.MANIFEST}" for name in names if name not in manifest["files"]]


def faults(folder: Path) -> list[str]:
    """Reasons why a run, or a sweep whose jobs have no folders, is not intact; empty if it is."""
    try:
        return list_faults(folder, manifests.read_file(folder / manifests.MANIFEST))
    except BadRun as error:
        return [str(error).removeprefix(f"{folder}: ")]


def list_faults(folder: Path, manifest: manifests.Manifest) -> list[str]:
    """:func:`faults` of a run whose manifest has been read."""
    changed = (
        f"{name}: {fault}"
        for name, expected in manifest["files"].items()
        if name not in VIEWS and (fault := manifests.check_file(folder, name, expected)) is not None
    )
    return [*_list_missing(manifest), *changed, *_list_changed_parts(folder, manifest)]


def _list_changed_parts(folder: Path, manifest: manifests.Manifest) -> list[str]:
    """List the parts of the tables of a running sweep that are not as a job left them."""
    parts = manifests.list_job_parts(folder) if manifest.get("kind") == manifests.SWEEP else []
    return [f"{part.relative_to(folder)}: changed since it was written" for part in parts if not is_whole_part(part)]


def is_whole_part(path: Path) -> bool:
    """Check whether a part of the tables of a running sweep is as a job left it."""
    with suppress(OSError):
        return manifests.current_hash(path) == path.name.partition("-")[2]
    return False
