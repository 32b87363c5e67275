"""Integrity of stored runs: completeness, unchanged files, and the match with a given config."""

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
from cmacexp.typing import RESULTS

DERIVED_FILES = (METRICS_CSV, RECORDING_FILE)
"""Files that can be computed from the others and are not checked; manifests of earlier versions list them."""


def compute_hashes(config: Config, *components: object) -> dict[str, str | None]:
    """Compute the hashes, as entries of the manifest, of everything besides the config that a result depends on.

    These are the code of this package, the code of custom components (of the objects ``components``, else of the
    classes that the config names), the weights that the run starts from, and the model of a robot. None stands for
    one that does not apply, and for weights whose file is missing.
    """
    machine = config.machine
    start = config.learning.start_from
    weights = Path(start) / WEIGHTS if start is not None else None
    return {
        "code_hash": manifests.read_environment().code_hash,
        "custom_code": custom_code_hash(config, *components),
        "start_weights": manifests.current_hash(weights) if weights and weights.is_file() else None,
        "model_hash": read_model(machine).model_hash if isinstance(machine, RobotMachine) else None,
    }


def is_finished(folder: Path, config: Config) -> bool:
    """Check whether ``folder`` contains the complete result of ``config``, computed by the present code.

    A run is finished if its manifest has the status of a result and the same hashes of config and code, every file
    that it lists exists unchanged, its traces have the requested rows, its weights are stored if requested, and
    neither the weights that it started from, nor the model of a robot, nor the code of custom components has changed.
    """
    try:
        manifest = manifests.read(folder)
    except BadRun:
        return False
    plain = to_plain(config)
    stored_record = manifest["config"].get("record", {})
    same = manifest["config_hash"] == config_hash(plain) and all(
        manifest[name] == value for name, value in compute_hashes(config).items()
    )
    has_steps = all(stored_record.get(key) == plain["record"][key] for key in ("every_nth_step", "cycles"))
    has_trace = (TRACE_FILE in manifest["files"] and has_steps) or not config.record.trace
    has_weights = WEIGHTS in manifest["files"] or not config.record.weights
    return same and has_trace and has_weights and manifest["status"] in RESULTS and not list_faults(folder, manifest)


def _list_missing(manifest: manifests.Manifest) -> list[str]:
    """List, as faults, the mandatory files that a manifest does not list; only runs with a result have such files."""
    if "kind" in manifest or manifest["status"] not in RESULTS:
        return []
    walks = MACHINES.get(manifest["config"]["machine"]["kind"]) in get_args(BodyMachine)
    names = [METRICS_FILE, BODY_METRICS_FILE] if walks else [METRICS_FILE]
    if manifest["config"].get("record", {}).get("trace", True):
        names += [TRACE_FILE, BODY_FILE] if walks else [TRACE_FILE]
    return [f"{name}: not listed in {manifests.MANIFEST}" for name in names if name not in manifest["files"]]


def faults(folder: Path) -> list[str]:
    """List why a run, or a sweep whose jobs have no folders, is not intact; empty if it is."""
    try:
        return list_faults(folder, manifests.read_file(folder / manifests.MANIFEST))
    except BadRun as error:
        return [str(error).removeprefix(f"{folder}: ")]


def list_faults(folder: Path, manifest: manifests.Manifest) -> list[str]:
    """List why a run or a sweep with this manifest is not intact, as :func:`faults`."""
    changed = (
        f"{name}: {fault}"
        for name, expected in manifest["files"].items()
        if name not in DERIVED_FILES and (fault := manifests.check_file(folder, name, expected)) is not None
    )
    return [*_list_missing(manifest), *changed, *_list_changed_parts(folder, manifest)]


def _list_changed_parts(folder: Path, manifest: manifests.Manifest) -> list[str]:
    """List the table parts in the folder of a sweep that have changed since its jobs wrote them, as faults."""
    paths = manifests.list_job_parts(folder) if manifest.get("kind") == manifests.SWEEP else []
    return [f"{path.relative_to(folder)}: changed since it was written" for path in paths if not is_whole_part(path)]


def is_whole_part(path: Path) -> bool:
    """Check whether a table part of a running sweep is unchanged: its name contains the hash of its content."""
    with suppress(OSError):
        return manifests.current_hash(path) == path.name.partition("-")[2]
    return False
