"""Workers of this machine: processes that are copies of one that has imported what runs need, or this process."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import connection, forkserver
from numbers import Integral
from threading import Thread, current_thread, main_thread
from types import ModuleType
from typing import Any

from cmacexp.errors import require
from cmacexp.jit.interrupt import interrupt_held_back

PRELOADED = "cmacexp.engine.preload"
"""Imports what workers need."""
MOST_RUNS = 32
"""Short runs that a worker takes at a time, at most."""
CHUNKS_EACH = 4
"""How often a worker comes back at least, if there are enough runs."""


def count_processes(processes: int | None) -> int:
    """Return the number of processes; None: one for each core that this process may use.

    Raises BadInput unless it is a whole number from 1 on.
    """
    if processes is None:
        return min(len(os.sched_getaffinity(0)), int(os.environ.get("SLURM_CPUS_PER_TASK", 1 << 20)))
    fits = isinstance(processes, Integral) and processes > 0
    require(fits, "processes", processes, "must be a whole number from 1 on, or None")
    return int(processes)


def choose_size(runs: int, workers: int) -> int:
    """Choose how many of this number of short runs a worker takes at a time."""
    return max(1, min(MOST_RUNS, runs // (CHUNKS_EACH * workers)))


def choose_ahead(executor: Executor) -> int:
    """Choose how many items are submitted at a time to processes that may have to end soon."""
    return 2 * executor.size if isinstance(executor, Processes) else 1


class Here(Executor):
    """Calls what is submitted in this process, at once."""

    def __init__(self) -> None:
        from cmacexp.terminal.messages import announce_compiling  # here, because it takes long to import

        announce_compiling()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call a function; the future has ended. An interrupt passes."""
        future = Future[Any]()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Processes(ProcessPoolExecutor):
    """Processes of this machine, which end with this one.

    At the end of its context they are ended, whatever they do: the files of runs are whole or absent.
    Raises FileNotFoundError if the current folder is gone.
    """

    def __init__(self, size: int):
        self.size = size
        context = make_context()
        self._ends, self._ending = multiprocessing.Pipe(duplex=False)
        super().__init__(size, context, _begin, (dict(os.environ), context.Semaphore(1), self._ends))
        with interrupt_held_back():  # a process that this one does not know of cannot be ended
            for _ in range(size):
                self.submit(os.getpid)  # let it start before there is work for it

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a call; a process that starts now does not import the caller's program, which needs no guard."""
        program, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            sys.modules["__main__"] = program

    def __exit__(self, *raised: object) -> None:
        """End the processes."""
        self._ending.close()
        self.shutdown(cancel_futures=True)
        self._ends.close()


def make_context() -> Any:
    """Make what starts processes, as copies of a first one, which is started now."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOADED])
    # All inherit it: Ctrl-C reaches them too, and the warning of SLURM every process of a task.
    ignored = (signal.SIGINT, signal.SIGUSR2) if current_thread() is main_thread() else ()
    before = {number: signal.signal(number, signal.SIG_IGN) for number in ignored}
    try:
        forkserver.ensure_running()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    return context


def _end_when_asked(ends: Any) -> None:
    """End this process when its parent has ended or closed the other end of a pipe."""
    parent = multiprocessing.parent_process()
    connection.wait([ends] if parent is None else [ends, parent.sentinel])
    os._exit(1)


def _begin(environment: Mapping[str, str], speaks: Any, ends: Any) -> None:
    """Begin to work, in the environment of the caller; the first process that ``speaks`` says that it compiles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_when_asked, args=(ends,), daemon=True).start()
    os.environ.update(environment)
    if speaks.acquire(block=False):
        from cmacexp.terminal.messages import announce_compiling  # here, because only workers have it already

        announce_compiling()


@contextmanager
def start_workers(processes: int | None = None) -> Iterator[Executor]:
    """Start this number of processes; None: one for each core. One is this process, which need not start others.

    Nor can it if it is a worker of another pool, such as ``multiprocessing.Pool``.
    """
    size = count_processes(processes)
    with Here() if size == 1 or multiprocessing.current_process().daemon else Processes(size) as executor:
        yield executor
