"""``python killing.py TIMES SEED FOLDER ARGUMENT...``: starts the command line in FOLDER and kills it, so often.

Each time it is a fork of this process, which has imported everything: the moments of the kills lie where it works.
After each kill FOLDER must hold nothing broken. What came to its end before its kill starts anew from nothing.
"""

import json
import os
import random
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq

from cmacexp.commands.main import main
from cmacexp.data.integrity import faults


def forked(work: Callable[[], int]) -> int:
    """The process that does ``work``; its exit code is what that gives."""
    process = os.fork()
    if not process:
        try:
            code = work()
        except BaseException as error:
            print(repr(error), file=sys.stderr)
            code = 99
        sys.stdout.flush()
        os._exit(code)
    return process


def start(folder: Path, arguments: list[str]) -> int:
    """The command line in a process of its own, silent."""

    def work() -> int:
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.argv = ["cmacexp", *arguments]
        return main()

    return forked(work)


def check(folder: Path, statuses: tuple[str, ...] = ("completed", "unfinished")) -> int:
    """Hold every file under a final name to being whole; hidden ones are on their way there."""
    for path in folder.rglob("*"):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if path.is_file() and not hidden:
            if path.suffix == ".parquet":
                assert pq.read_table(path).num_columns, path
            elif path.suffix == ".csv":
                assert path.read_bytes().endswith(b"\n"), path
            elif path.name == "manifest.json":
                manifest = json.loads(path.read_text())
                assert manifest["status"] in statuses, path
                assert "kind" in manifest or not faults(path.parent), path  # that of a sweep lists no files
    return 0


def end_of(process: int) -> int:
    """Exit code of a process; negative if it was killed."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def kill_often(times: int, chance: random.Random, folder: Path, arguments: list[str]) -> None:
    """Kill as often as asked for; tells how many of the kills came in time."""
    began = time.perf_counter()
    assert end_of(start(folder, arguments)) == 0
    longest, killed = time.perf_counter() - began, 0
    shutil.rmtree(folder / "out")
    while killed < times:
        process = start(folder, arguments)
        time.sleep(chance.uniform(0.0, longest))
        os.kill(process, signal.SIGKILL)
        if end_of(process) == -signal.SIGKILL:
            killed += 1
        else:
            shutil.rmtree(folder / "out")
        assert end_of(forked(lambda: check(folder))) == 0


if __name__ == "__main__":
    kill_often(int(sys.argv[1]), random.Random(int(sys.argv[2])), Path(sys.argv[3]), sys.argv[4:])
