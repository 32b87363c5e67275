"""What a plant that is not simulated needs: an end in which it comes to rest, and nothing that keeps it waiting."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from cmacexp.typing import Status

T = TypeVar("T")


def is_live(plant: Any) -> bool:
    """Whether a plant must not wait: it has a function ``leave_real_time()``."""
    return hasattr(plant, "leave_real_time")


@contextmanager
def ending(plant: Any) -> Iterator[Callable[[str], None]]:
    """Whatever happens inside, let ``plant`` come to rest after it, if it has an ``end_run(is_safe)``.

    It is safe if the function that this gives was called with a status that says so: the walk has completed, or the
    user has interrupted it. Else a component has failed, the machine fell, or a limit was passed.
    """
    statuses: list[str] = []
    try:
        yield statuses.append
    finally:
        if hasattr(plant, "end_run"):
            plant.end_run(bool(statuses) and statuses[-1] in (Status.COMPLETED, Status.INTERRUPTED))


@contextmanager
def beside(plant: Any, keep: Callable[[T], None]) -> Iterator[Callable[[T], None]]:
    """``keep`` itself, or, for a ``plant`` that must not wait for it, what lets another thread do its work.

    That thread calls its ``leave_real_time()`` first. Raises what ``keep`` raised, at its next call or at the end.
    """
    if not is_live(plant):
        yield keep
        return
    with ThreadPoolExecutor(1, initializer=plant.leave_real_time) as thread:
        jobs: list[Future[None]] = []

        def submit(samples: T) -> None:
            while jobs and jobs[0].done():
                jobs.pop(0).result()
            jobs.append(thread.submit(keep, samples))

        yield submit
        for job in jobs:
            job.result()
