"""Folders whose result a run may replace, and those that hold something else."""

import os
from collections.abc import Collection
from contextlib import AbstractContextManager
from pathlib import Path

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import HYDRA_FOLDER
from cmacexp.data.files import FAILED, LOCK, NEW, remove_leftovers
from cmacexp.data.staging import Place, is_taken, refuse_if_taken, replacing
from cmacexp.data.tables import BODY, BODY_METRICS, MEMORY, METRICS, METRICS_CSV, RECORDING, TRACE
from cmacexp.data.weights import WEIGHTS
from cmacexp.errors import BadInput, BadRun

RUN_FILES = (TRACE, BODY, MEMORY, METRICS, METRICS_CSV, BODY_METRICS, RECORDING, WEIGHTS)
"""Files that a run can have besides its manifest."""
RUN_KEY, GIVEN_KEY = "hydra.run.dir", "DIR"
"""What names the folder of a run on the command line: of the run itself, and of commands over runs."""


def read_earlier(folder: Path, key: str) -> manifests.Manifest | None:
    """The manifest of what ``folder`` holds; None if it has none.

    Args:
        folder: to read.
        key: what names it on the command line.

    Raises:
        BadInput: its manifest is none of this project, or damaged.
    """
    if not is_taken(folder / manifests.NAME):
        return None
    try:
        return manifests.read(folder)
    except BadRun as error:
        reason = f"holds another {manifests.NAME} ({error}); remove that file, or choose another folder"
        raise BadInput(key, folder, " ".join(reason.split())) from None


def _find_run(folder: Path, key: str) -> frozenset[str]:
    manifest = read_earlier(folder, key)
    if manifest is not None and "kind" in manifest:
        raise BadInput(key, folder, f"holds a {manifest['kind']}; choose another folder")
    remove_leftovers(folder, (*RUN_FILES, manifests.NAME))
    earlier = frozenset(manifest["files"]) & frozenset(RUN_FILES) if manifest is not None else frozenset[str]()
    recorded = manifest is None and (folder / HYDRA_FOLDER).exists()
    for name in RUN_FILES:
        if recorded and is_taken(folder / name):  # up to 0.2 a run that was killed left them so
            reason = f"holds {name} but no {manifests.NAME}, as a run of an earlier version that was killed; "
            raise BadInput(key, folder, f"{reason}move or delete that folder, then repeat the command")
        if name not in earlier:
            refuse_if_taken(folder, name, key)
    if recorded:
        others = set(os.listdir(folder)) - {HYDRA_FOLDER, NEW, FAILED, LOCK}
        if others:  # a run that was killed leaves nothing else
            reason = f"holds the results of another program ({min(others)}); "
            raise BadInput(key, folder, f"{reason}choose another folder, or remove {HYDRA_FOLDER}")
    return earlier


def run_place(folder: Path, wait: bool = False) -> AbstractContextManager[Place]:
    """Lock the folder of a run, see :func:`cmacexp.data.staging.replacing`.

    Args:
        folder: made if missing; may hold an earlier run, and files that have other names than those of a run.
        wait: until no other process writes there.

    Raises:
        BadInput: another process writes there, or the run would replace what is not of an earlier run.
        OSError: the folder cannot be written.
    """
    return replacing(folder, RUN_KEY, _find_run, wait)


def update_place(folder: Path, names: Collection[str]) -> AbstractContextManager[Place]:
    """Lock the folder of a run in which only some files are to be written anew.

    Args:
        folder: of the run.
        names: of these files.

    Raises:
        BadInput: another process writes there.
        BadRun: the folder holds no run.
        OSError: the folder cannot be written.
    """

    def find(folder: Path, key: str) -> frozenset[str]:
        remove_leftovers(folder, (*names, manifests.NAME))
        return frozenset(manifests.read(folder)["files"]) & frozenset(names)

    return replacing(folder, GIVEN_KEY, find)
