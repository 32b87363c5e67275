"""Lets one write of a command fail, each in turn: what must hold then.

Each time the folder is a copy of what it was, and the command runs in a fork of this process. Then every run and
report below the folder must be whole, the earlier one or the new one; and nothing may be left over once the command
has run again.
"""

import errno
import importlib
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from support.killing import check, end_of, forked

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import everything_below
from cmacexp.data.integrity import faults

NEVER = 100
"""Exit code of a command that has fewer writes."""
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate")


class Failing:
    """Fails a write to a file below a folder, that of the given number."""

    def __init__(self, folder: Path, number: int):
        self.folder, self.left = str(folder), number

    def count(self, path: object) -> None:
        if os.path.abspath(os.fsdecode(path)).startswith(self.folder):
            self.left -= 1
            if self.left == 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    def audit(self, event: str, arguments: tuple) -> None:
        writes = event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        if (writes or event in CHANGES) and isinstance(arguments[0], str | bytes | os.PathLike):
            self.count(arguments[0])

    def wrap(self, owner: object, name: str, find: Callable[..., object]) -> None:
        """Count the calls of a function whose own writes no audit event shows."""
        function = getattr(owner, name)

        def counted(*args, **kwargs):
            self.count(find(*args))
            return function(*args, **kwargs)

        setattr(owner, name, counted)

    def install(self) -> None:
        def cut(path: Path, text: str, encoding: str | None = None) -> int:
            with path.open("w", encoding=encoding) as file:
                file.write(text[: len(text) // 2])
                file.flush()
                self.count(path)
                return file.write(text[len(text) // 2 :])

        Path.write_text = cut
        self.wrap(os, "fsync", self._name)
        self.wrap(os, "posix_fallocate", self._name)
        self.wrap(pa_csv, "write_csv", lambda table, path: path)
        for name in ("write_table", "close"):
            self.wrap(pq.ParquetWriter, name, lambda writer, *rest: self.folder)
        sys.addaudithook(self.audit)

    @staticmethod
    def _name(handle: int, *rest: object) -> str:
        return os.readlink(f"/proc/self/fd/{handle}")


def start(folder: Path, words: list[str], number: int | None) -> int:
    """The exit code of the command; its output is in ``out`` and ``err`` beside the folder."""

    def work() -> int:
        os.chdir(folder)
        for stream, name in ((1, "out"), (2, "err")):
            os.dup2(os.open(folder.parent / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
        sys.argv = words
        main = importlib.import_module(words[0]).main
        failing = Failing(folder, number) if number else None
        if failing:
            failing.install()
        code = main()
        return NEVER if failing and failing.left > 0 else code

    return end_of(forked(work))


def contents(folder: Path) -> dict[str, str]:
    """What each run or report is: the hashes of what it computed."""
    found = {}
    for place in everything_below(folder):
        assert not faults(place), (place, faults(place))
        manifest = manifests.read(place)
        if manifest.get("kind") != manifests.SWEEP:  # its table may also list a job that failed
            found[str(place.relative_to(folder))] = json.dumps(manifest["files"], sort_keys=True)
    return found


NOTHING = "{}"
"""The files of a job that failed where there was no earlier result."""


def look(before: Path, folder: Path, after: dict[str, str]) -> None:
    """Each result must be whole, and be the earlier one or the new one."""
    earlier, now = contents(before), contents(folder)
    assert now.keys() >= earlier.keys(), "a result is gone"
    for name, value in now.items():
        assert value in (earlier.get(name, NOTHING), after.get(name)), f"{name}: neither the earlier nor the new"


def fail(numbers: Iterable[int], again: bool, folder: Path, words: list[str]) -> int:
    """Let writes of a command fail; how many did.

    Args:
        numbers: of the writes, in ascending order; the command may have fewer.
        again: run the command once more each time.
        folder: where it runs.
        words: module and arguments of the command.
    """
    before, tried = folder.with_name("before"), 0
    folder.rename(before)
    shutil.copytree(before, folder)
    assert start(folder, words, None) == 0, folder.with_name("err").read_text()
    after = contents(folder)
    for number in numbers:
        shutil.rmtree(folder)
        shutil.copytree(before, folder)
        code = start(folder, words, number)
        if code == NEVER:
            break
        said = folder.with_name("err").read_text()
        assert code in (0, 1, 2), (number, code, said)
        assert "Traceback" not in said, (number, said)
        check(folder, ("completed", "failed"))
        look(before, folder, after)
        tried += 1
        if again:
            assert start(folder, words, None) == 0, (number, folder.with_name("err").read_text())
            assert not list(folder.rglob(".cmacexp*")), number
    return tried
