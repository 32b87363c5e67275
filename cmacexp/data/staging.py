"""Replacing a result as a whole: files are written beside the earlier ones, and take their place at the end.

The manifest makes a result whole: it is removed before any other file changes, and comes last.
"""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmacexp.data.files import FAILED, NEW, alone_in, write_atomically
from cmacexp.data.manifest_text import NAME, dump
from cmacexp.errors import BadInput

OBSOLETE = ".obsolete.json"
"""Names of files of the earlier result that the new one does not have."""


def is_taken(path: Path) -> bool:
    """Whether there is something of this name, be it a link to nothing."""
    return os.path.lexists(path)


@dataclass(frozen=True)
class Place:
    """A locked folder whose result this process replaces."""

    folder: Path
    key: str
    """What names the folder on the command line."""
    earlier: frozenset[str]
    """Names of the files in the folder that belong to the earlier result."""

    @property
    def new(self) -> Path:
        """Where files are written: below the folder itself, so that they are renamed within one file system."""
        return self.folder / NEW

    def write_text(self, name: str, text: str) -> None:
        """Write a file of text."""
        path = self.new / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def commit(self, manifest: dict[str, Any]) -> None:
        """Replace the earlier result; what interrupts this in the middle, :func:`finish_replacement` makes good.

        Args:
            manifest: of the new result.

        Raises:
            BadInput: the folder holds a file of the same name that is not of the earlier result; nothing is replaced.
            OSError: the disk refuses a file.
        """
        for name in _list_files(self.new):
            if not name.startswith(".") and name not in self.earlier:
                refuse_if_taken(self.folder, name, self.key)
        obsolete = [name for name in sorted(self.earlier) if not (self.new / name).exists()]
        self.write_text(OBSOLETE, json.dumps(obsolete))
        self.write_text(NAME, dump(manifest))
        _replace(self.folder)

    def leave_failure(self, manifest: dict[str, Any]) -> None:
        """Leave the record of an attempt that failed beside the earlier result.

        Args:
            manifest: of the attempt.
        """
        failed = self.new.rename(self.folder / FAILED)
        with write_atomically(failed / NAME) as temporary:
            temporary.write_text(dump(manifest), encoding="utf-8")


def refuse_if_taken(folder: Path, name: str, key: str) -> None:
    """Refuse to write a file where something else has its name.

    Raises:
        BadInput: so it is; the message names it.
    """
    if is_taken(folder / name):
        reason = f"holds {name}, which is of no earlier result that {NAME} lists; move it, or choose another folder"
        raise BadInput(key, folder, reason)


def _list_files(new: Path) -> list[str]:
    return sorted(path.relative_to(new).as_posix() for path in new.rglob("*") if path.is_file())


def _replace(folder: Path) -> None:
    """Move what has been written to its place; begun anew after a kill, it comes to the same end."""
    new = folder / NEW
    (folder / NAME).unlink(missing_ok=True)
    for name in json.loads((new / OBSOLETE).read_text()):
        (folder / name).unlink(missing_ok=True)
    for name in _list_files(new):
        if name not in (NAME, OBSOLETE):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).replace(folder / name)
    (new / NAME).replace(folder / NAME)
    shutil.rmtree(new, ignore_errors=True)


def finish_replacement(folder: Path) -> None:
    """Move a whole new result to its place, if a killed process did not come to that."""
    with suppress(BadInput, OSError):
        if (folder / NEW / NAME).exists():
            with alone_in(folder, NAME):
                if (folder / NEW / NAME).exists():
                    _replace(folder)


@contextmanager
def replacing(
    folder: Path, key: str, find_earlier: Callable[[Path, str], frozenset[str]], wait: bool = False
) -> Iterator[Place]:
    """Lock a folder to replace its result; what is not committed in the block is removed at its end.

    Args:
        folder: made if missing, and removed if it stays empty.
        key: what names the folder on the command line.
        find_earlier: gives the files of the earlier result, or refuses the folder for what it holds.
        wait: until no other process writes there.

    Raises:
        BadInput: another process writes there, or ``find_earlier`` refuses the folder.
        OSError: the folder cannot be written.
    """
    made = not folder.exists()
    try:
        with alone_in(folder, key, wait):
            if (folder / NEW / NAME).exists():
                _replace(folder)
            place = Place(folder, key, find_earlier(folder, key))
            for leftover in (NEW, FAILED):
                shutil.rmtree(folder / leftover, ignore_errors=True)
            place.new.mkdir()
            try:
                yield place
            finally:
                if not (place.new / NAME).exists():
                    shutil.rmtree(place.new, ignore_errors=True)
    finally:
        if made:
            with suppress(OSError):  # it is not empty
                folder.rmdir()
