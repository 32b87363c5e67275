"""The driver of many runs: it maps picklable items over one function, on any ``concurrent.futures.Executor``.

Sweeps, studies, ``run_many`` and ``write_many`` use it, with processes of this machine, Dask, SLURM or an executor of
the user. It holds what is under way, not what is to come or has ended.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from queue import SimpleQueue
from typing import Any

from cmacexp.jit.interrupt import exits_caught
from cmacexp.terminal.output import show_progress

AHEAD = 1 << 7
"""Items that are submitted at a time at most, and whose results nobody has taken."""
Item = Sequence[Any]
"""Arguments of one call of the function."""


@exits_caught()  # a worker would hand a SystemExit to the program, which would end with its code
def do_item(work: Callable[..., Any], item: Item) -> Any:
    """Call the function with the arguments in an item."""
    return work(*item)


def _describe_tasks(pending: Iterable[Future[Any]]) -> str:
    """Describe tasks that have not ended by the numbers of those that run and of those that wait."""
    tasks = list(pending)
    running = sum(task.running() for task in tasks)
    return f"{running} tasks run, {len(tasks) - running} wait" if running else ""


def map_runs(
    work: Callable[..., Any],
    items: Iterable[Item],
    executor: Executor,
    what: str = "running",
    total: int | None = None,
    count_runs: Callable[[Item], int] = lambda item: 1,
    on_lost: Callable[[str], None] | None = None,
    ahead: int = AHEAD,
) -> Iterator[tuple[int, Any]]:
    """Yield the index of each item and what ``work(*item)`` returns, as soon as it has ended.

    Args:
        work: a function that can be pickled, unless the executor stays in this process.
        items: arguments of each call; drawn as the executor comes to them.
        executor: where the calls are made.
        what: name of the work beside its progress.
        total: number of runs in all items, for the progress; None: unknown.
        count_runs: gives the number of runs in an item.
        on_lost: takes why an item was lost with the process that did it, and the others go on; None: that is raised.
        ahead: items that are submitted and not yet yielded, at most.

    Raises:
        ChildProcessError: a worker process was killed, or a task was lost and there is no ``on_lost``.
        Exception: of ``work``. Whatever ends the iteration cancels the items that wait.
    """
    finished = SimpleQueue[Future[Any]]()
    pending = dict[Future[Any], tuple[int, int]]()
    done = 0
    try:
        with show_progress(what, total, describe=lambda: _describe_tasks(pending)) as set_done:

            def take() -> Iterator[tuple[int, Any]]:
                nonlocal done
                future = finished.get()
                index, runs = pending.pop(future)
                done += runs
                set_done(done)
                try:
                    yield index, future.result()
                except ChildProcessError as error:
                    if on_lost is None:
                        raise
                    on_lost(str(error))

            for index, item in enumerate(items):
                future = executor.submit(do_item, work, item)
                pending[future] = index, count_runs(item)
                future.add_done_callback(finished.put)
                while len(pending) >= ahead or not finished.empty():
                    yield from take()
            while pending:
                yield from take()
    except BrokenExecutor as error:
        raise ChildProcessError(
            "a worker process was killed, perhaps for want of memory; completed runs are kept"
        ) from error
    except CancelledError as error:
        raise ChildProcessError("a task was cancelled; completed runs are kept") from error
    finally:
        for future in pending:
            future.cancel()
