"""Worker processes: copies of one that has imported what they need, which end with the one that they work for."""

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import count
from multiprocessing import forkserver
from numbers import Integral
from threading import Thread, current_thread, main_thread
from types import ModuleType
from typing import Any

from cmacexp.errors import require
from cmacexp.jit.interrupt import exits_caught, interrupt_held_back

PRELOADED = "cmacexp.engine.preload"
"""Imports what workers need."""
MOST_RUNS, CHUNKS_EACH = 32, 4
"""Short runs that a process takes at a time, at most, and how often it comes back at least, if there are enough."""
ParallelMap = Callable[..., Iterator[Any]]
"""``parallel_map(what, work, items, runs=None)``: gives what ``work(*item)`` returns for each item, in their order.

``what`` is shown beside the progress, of so many ``runs`` if an item is several. Work begins when the first result is
asked for, and goes on while the caller uses a result."""


@exits_caught()  # a worker would hand a SystemExit to the program, which would end with its code
def run_item(work: Callable[..., Any], item: Sequence[Any]) -> Any:
    """Do one item."""
    return work(*item)


def count_processes(asked: int | None) -> int:
    """The number of processes that is asked for; None: one for each core that this process may use."""
    if asked is None:
        return len(os.sched_getaffinity(0))
    require(
        isinstance(asked, Integral) and asked > 0,
        "processes",
        asked,
        "must be a whole number from 1 on, or None",
    )
    return int(asked)


def choose_size(runs: int, processes: int) -> int:
    """How many of so many short runs a process takes at a time."""
    return max(1, min(MOST_RUNS, runs // (CHUNKS_EACH * processes)))


def make_context() -> Any:
    """What starts processes, as copies of a first one, which is started now.

    Raises FileNotFoundError if the current folder is gone.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOADED])
    says = current_thread() is main_thread()  # which alone may say what a signal does
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if says else None  # all inherit it: Ctrl-C reaches them too
    try:
        forkserver.ensure_running()
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)
    return context


def _end_with_parent() -> None:
    if (parent := multiprocessing.parent_process()) is not None:
        parent.join()
        os._exit(1)


def _begin(environment: Mapping[str, str], speaks: Any) -> None:
    """Begin to work, in the environment of the caller; the first process that ``speaks`` says that it compiles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()
    os.environ.update(environment)
    if speaks.acquire(block=False):
        from cmacexp.terminal.messages import announce_compiling  # here, because only workers have it already

        announce_compiling()


def iterate_here(
    what: str, work: Callable[..., Any], items: Sequence[Sequence[Any]], runs: int | None = None
) -> Iterator[Any]:
    """A :data:`ParallelMap` in this process."""
    from cmacexp.terminal.messages import announce_compiling  # here, because it takes long to import
    from cmacexp.terminal.output import show_progress

    announce_compiling()
    total = runs or len(items)
    with show_progress(what, total) as set_done:
        for done, item in enumerate(items, 1):
            yield run_item(work, item)
            set_done(total * done / len(items))


@contextmanager
def start_workers(processes: int | None = None) -> Iterator[ParallelMap]:
    """Start processes, one for each core unless another number is asked for; gives what does work in them.

    It takes one more argument, how many items are at most begun and not yet asked for; None: all. It raises what
    ``work`` raises, and ChildProcessError if a process was killed. Work that goes on when the context is left is
    ended at once: the files of runs are whole or absent.
    """
    size = count_processes(processes)
    others, context = set(multiprocessing.active_children()), make_context()
    executor = ProcessPoolExecutor(size, context, _begin, (dict(os.environ), context.Semaphore(1)))

    def submit(*call: Any) -> Future[Any]:
        # A process that starts here must not import the program of the caller, which then needs no guard.
        program, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
        try:
            return executor.submit(*call)
        finally:
            sys.modules["__main__"] = program

    def parallel_map(
        what: str,
        work: Callable[..., Any],
        items: Sequence[Sequence[Any]],
        runs: int | None = None,
        ahead: int | None = None,
    ) -> Iterator[Any]:
        from cmacexp.terminal.output import show_progress  # here, because it takes long to import

        total, ended, begun = runs or len(items), count(1), deque[Future[Any]]()
        try:
            with show_progress(what, total) as set_done:
                for item in items:
                    if len(begun) == ahead:
                        yield begun.popleft().result()
                    begun.append(submit(run_item, work, item))
                    begun[-1].add_done_callback(lambda _: set_done(total * next(ended) / len(items)))
                while begun:
                    yield begun.popleft().result()
        except BrokenProcessPool as error:
            raise ChildProcessError(
                "a worker process was killed, perhaps for want of memory; completed runs are kept"
            ) from error

    try:
        with interrupt_held_back():  # a process that this one does not know of cannot be ended
            for _ in range(size):
                submit(os.getpid)  # let it start before there is work for it
        yield parallel_map
    finally:
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        executor.shutdown(cancel_futures=True)
