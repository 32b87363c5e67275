"""Processes that work for this one: they end with it, and report how far they are."""

import gc
import os
import select
import signal
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import cache
from multiprocessing import active_children
from pathlib import Path
from tempfile import NamedTemporaryFile
from threading import Thread
from types import ModuleType
from typing import Any

from cmacexp.engine.forking import make_context
from cmacexp.jit.interrupt import exits_caught
from cmacexp.terminal.output import State, format_progress, show_state

Each = Callable[..., list[Any]]
RunAll = Callable[..., list[Any]]
VARIABLE = "CMACEXP_WORK"
"""Environment variable of workers: host and id of the process they work for, and the file of what is done."""
SHARE = struct.Struct("d")
"""What is done of one item, 0 to 1 or FAILED_SHARE, in that file."""
FAILED_SHARE = 2.0
"""Of an item that failed."""


@contextmanager
def shared_progress(what: str, count: Callable[[], int], unit: str = "") -> Iterator[Path]:
    """Show how much is done of items of work that any process does; gives the file that holds it."""
    with NamedTemporaryFile(prefix="cmacexp-") as file:
        os.environ[VARIABLE] = f"{socket.gethostname()} {os.getpid()} {file.name}"
        path, began = Path(file.name), time.monotonic()

        def look() -> State:
            nonlocal began
            shares = [share for (share,) in SHARE.iter_unpack(path.read_bytes())]
            done, failed = sum(min(share, 1.0) for share in shares), shares.count(FAILED_SHARE)
            began = began if done else time.monotonic()  # workers take seconds to start
            text = format_progress(what, done, total := count(), unit, time.monotonic() - began)
            return f"{text}, {failed} failed" if failed else text, done / total if total else None

        with show_state(look):
            yield path
        del os.environ[VARIABLE]


def share_progress(number: int) -> Callable[[float], None]:
    """In any process: begin an item of shared work; gives what reports how much of it is done.

    From now on a worker ends when the process that it works for has ended, killed or not.
    """
    host, parent, path = os.environ.get(VARIABLE, "  ").split(" ", 2)
    if host == socket.gethostname() and int(parent) != os.getpid():
        _end_with(int(parent))

    def report(share: float) -> None:
        with suppress(OSError), open(path, "r+b") as file:  # there is none on another machine
            file.seek(number * SHARE.size)
            file.write(SHARE.pack(share))

    return report


@cache
def _end_with(process: int) -> None:
    """End with this process, also if nobody has asked how it ended, and leave Ctrl-C to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        with suppress(ProcessLookupError):
            select.select([os.pidfd_open(process)], [], [])
        os._exit(1)

    Thread(target=watch, daemon=True).start()


@exits_caught()  # a worker would hand a SystemExit to the program, which would end with its code
def work_on(shared: str, number: int, work: Callable[..., Any], item: tuple[Any, ...]) -> Any:
    """In any process: do one item of shared work, whose progress is reported to where ``VARIABLE`` was ``shared``."""
    os.environ[VARIABLE] = shared  # of these items: a process that works on already has that of the last ones
    report = share_progress(number)
    result = work(*item)
    report(1.0)
    return result


def _start(environment: Mapping[str, str], parent: int) -> None:
    """Begin as a process that ``parent`` has started would; it may end before there is work."""
    _end_with(parent)
    os.environ.update(environment)
    gc.freeze()  # what has been imported is no garbage


@contextmanager
def start_pool(processes: int | None = None) -> Iterator[RunAll]:
    """Start processes, one for each core unless so many are asked for; gives ``run_all(work, items, first)``.

    That gives ``work`` of every item, in their order, within :func:`shared_progress`, whose first item is ``first``.
    What ``work`` raises is raised, once all work that has begun is done; the rest is dropped. An interrupt ends the
    processes at once: their files are whole or absent.
    """
    count = processes or len(os.sched_getaffinity(0))
    pool = ProcessPoolExecutor(count, make_context(), _start, (dict(os.environ), os.getpid()))

    def submit(*call: Any) -> Future[Any]:
        # Processes start here. They inherit that Ctrl-C is ignored, which reaches them too; and they do not import
        # the program of the caller, which needs no guard then.
        before, program = signal.signal(signal.SIGINT, signal.SIG_IGN), sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            return pool.submit(*call)
        finally:
            sys.modules["__main__"] = program
            signal.signal(signal.SIGINT, before)

    is_idle = True

    def run_all(work: Callable[..., Any], items: Sequence[tuple[Any, ...]], first: int = 0) -> list[Any]:
        nonlocal is_idle
        shared, is_idle = os.environ[VARIABLE], False
        try:
            futures = [submit(work_on, shared, number, work, item) for number, item in enumerate(items, first)]
            for future in as_completed(futures):
                future.result()
        except BrokenProcessPool as error:
            raise ChildProcessError(
                "a worker process was killed, perhaps for want of memory; completed runs are kept"
            ) from error
        except KeyboardInterrupt:
            for process in active_children():
                process.terminate()
            raise
        is_idle = True
        return [future.result() for future in futures]

    for _ in range(count):
        submit(os.getpid)  # let it start before there is work for it
    try:
        yield run_all
    except BaseException:
        is_idle = False  # what it holds is not collected before the end of the program
        raise
    finally:
        if is_idle:  # it may still be starting
            for process in active_children():
                process.terminate()
        pool.shutdown(cancel_futures=True)


@contextmanager
def workers(elsewhere: RunAll | None = None, processes: int | None = None) -> Iterator[Each]:
    """Processes for all cores; gives ``each(what, work, items)``, which shows ``what`` beside the progress.

    ``elsewhere`` does the items of ``each(what, work, items, long=True)``, else the same processes.
    """
    with start_pool(processes) as run_here:

        def each(
            what: str, work: Callable[..., Any], items: Sequence[tuple[Any, ...]], long: bool = False
        ) -> list[Any]:
            with shared_progress(what, lambda: len(items)):
                return (elsewhere if elsewhere and long else run_here)(work, items)

        yield each
