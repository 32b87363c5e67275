"""Workers of this machine: processes that are copies of one that has imported what runs need, or this process."""

import multiprocessing
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from itertools import count
from numbers import Integral
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from cmacexp.errors import require
from cmacexp.jit.interrupt import interrupt_held_back

CONTROL = Path("/sys/fs/cgroup")
"""Folder of the control groups of Linux."""
GROUPS = Path("/proc/self/cgroup")
"""Control groups of this process, a line for each hierarchy: number, kinds of resources, path."""
MOST_RUNS = 32
"""Short runs that a worker takes at a time, at most."""
CHUNKS_EACH = 4
"""How often a worker comes back at least, if there are enough runs."""


def count_processes(processes: int | None) -> int:
    """Return the number of processes; None: one for each core that this process may use.

    A container's quota of processor time counts as cores, rounded up. Raises BadInput unless the number is whole and
    at least 1.
    """
    if processes is None:
        limits = len(os.sched_getaffinity(0)), int(os.environ.get("SLURM_CPUS_PER_TASK", 1 << 20)), *_list_quotas()
        return max(1, min(limits))
    fits = isinstance(processes, Integral) and processes > 0
    require(fits, "processes", processes, "must be a whole number from 1 on, or None")
    return int(processes)


def _list_quotas() -> Iterator[int]:
    """Yield the quotas of processor time of the control groups of this process, cores, rounded up.

    A group has them in ``cpu.max``, with version 1 in ``cpu.cfs_quota_us`` and ``cpu.cfs_period_us``; those of the
    groups above it hold too. Inside a container the files of its own group stand at the top.
    """
    with suppress(OSError, ValueError):
        for line in GROUPS.read_text().splitlines():
            _, kinds, group = line.split(":", 2)
            if not kinds or "cpu" in kinds.split(","):
                top = CONTROL / kinds
                own_group = top / group.lstrip("/")
                for folder in (own_group, *own_group.parents):
                    if folder.is_relative_to(top):
                        yield from _read_quota(folder)


def _read_quota(group: Path) -> Iterator[int]:
    """Yield the quota of a control group, cores, rounded up; nothing if it has none."""
    with suppress(OSError, ValueError):  # version 1 has -1, version 2 has max where there is no quota
        files = [group / name for name in ("cpu.max", "cpu.cfs_quota_us", "cpu.cfs_period_us")]
        quota, period = " ".join(file.read_text() for file in files if file.exists()).split()
        if int(quota) > 0:
            yield -(-int(quota) // int(period))


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


class Processes(Executor):
    """Processes of this machine, which belong to one of their own, see :mod:`cmacexp.engine.pool`.

    They end with the context, whatever they do, and with this process. Raises FileNotFoundError if the current folder
    is gone.
    """

    def __init__(self, size: int):
        os.getcwd()
        self.size = size
        with interrupt_held_back():  # a process that this one does not know of cannot be ended
            self._pool, self._connection = _prepared.pop() if _prepared else _start_pool()
        self._connection.send(size)
        self._futures = dict[int, Future[Any]]()
        self._numbers = count()
        self._sending = Lock()
        self._receiver = Thread(target=self._receive, daemon=True)
        self._receiver.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a call; what cannot be pickled is the error of its future."""
        future = Future[Any]()
        try:
            packed = pickle.dumps((fn, args))
        except Exception as error:
            future.set_exception(error)
            return future
        with self._sending:
            number = next(self._numbers)
            self._futures[number] = future
            try:
                self._connection.send((number, packed))
            except OSError as error:
                raise BrokenExecutor(str(error)) from error
        return future

    def _receive(self) -> None:
        """End futures as their calls end, until the pool has ended."""
        with suppress(Exception):  # at its end, or an error of a component that cannot be unpickled
            while True:
                number, packed, error = self._connection.recv()
                future = self._futures.pop(number)
                if future.set_running_or_notify_cancel():
                    if error is None:
                        future.set_result(pickle.loads(packed))
                    else:
                        future.set_exception(error)
        for future in [*self._futures.values()]:
            if future.set_running_or_notify_cancel():
                future.set_exception(BrokenExecutor("the pool of workers has ended"))

    def __exit__(self, *raised: object) -> None:
        """End the processes."""
        for future in [*self._futures.values()]:
            future.cancel()
        with self._sending, suppress(OSError):  # the pool has been killed
            self._connection.send(None)
        self._pool.wait()
        self._receiver.join()
        self._connection.close()


_prepared = list[tuple["subprocess.Popen[bytes]", Any]]()
"""A pool that has been started and is not used yet."""


def _start_pool() -> tuple["subprocess.Popen[bytes]", Any]:
    """Start the process of a pool; returns it and the connection to it."""
    own_end, other_end = multiprocessing.Pipe()
    number = other_end.fileno()
    program = f"import sys; sys.path[:] = {sys.path!r}; from cmacexp.engine.pool import main; main({number})"
    process = subprocess.Popen(  # in a session of its own, which Ctrl-C does not reach
        [sys.executable, "-c", program], pass_fds=[number], stdin=subprocess.DEVNULL, start_new_session=True
    )
    other_end.close()
    return process, own_end


def prepare_pool() -> None:
    """Start a pool ahead of its use: what workers need is imported while this process imports what it needs."""
    _prepared.append(_start_pool())


@contextmanager
def start_workers(processes: int | None = None) -> Iterator[Executor]:
    """Start this number of processes; None: one for each core. One is this process, which need not start others.

    Nor can it if it is a worker of another pool, such as ``multiprocessing.Pool``.
    """
    size = count_processes(processes)
    with Here() if size == 1 or multiprocessing.current_process().daemon else Processes(size) as executor:
        yield executor
