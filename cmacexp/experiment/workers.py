"""Work on all cores, with its progress shown to a person who watches."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any

from cmacexp.errors import CmacexpError
from cmacexp.jit.interrupt import interrupt_blocked
from cmacexp.report.terminal import progress

Each = Callable[[str, Callable[..., Any], Sequence[tuple[Any, ...]]], list[Any]]


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def workers() -> Iterator[Each]:
    """Start a process for every core; gives ``each(what, work, items)``: ``work`` of every item, in their order.

    ``what`` is shown beside the progress. What ``work`` raises is raised; work that has not begun is dropped then.
    Ctrl-C ends the processes at once: their files are whole or absent.

    Raises:
        CmacexpError: a process was killed.
    """
    pool = ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), _leave_interrupts_to_the_parent)

    def each(what: str, work: Callable[..., Any], items: Sequence[tuple[Any, ...]]) -> list[Any]:
        with interrupt_blocked():  # or a worker prints a stack trace while it begins
            futures = [pool.submit(work, *item) for item in items]
        with progress(what, len(items)) as watch:
            for done, future in enumerate(as_completed(futures), start=1):
                future.result()
                watch(done)
        return [future.result() for future in futures]

    try:
        yield each
    except BrokenProcessPool as error:
        raise CmacexpError(
            "a worker process was killed, perhaps for want of memory; completed runs are kept"
        ) from error
    except KeyboardInterrupt:
        for process in active_children():
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
