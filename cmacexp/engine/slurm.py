"""Tasks of SLURM as an executor, by submitit: each call is a task, those submitted in the same moment are one array.

A task does its share of the items on the cores that it was given, and stores their results as they come. SLURM sends
USR2 before a time limit or to preempt a task, which then ends between two items; submitit has it queued again.
"""

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from cmacexp.engine.driver import Item, map_runs
from cmacexp.engine.workers import choose_ahead, start_workers
from cmacexp.errors import CmacexpError
from cmacexp.terminal.output import print_line

INTERVAL, QUEUE_INTERVAL = 0.25, 3.0
"""Seconds between two looks at the results of tasks, and at SLURM's queue."""
PATIENCE = 20.0
"""Seconds after which a task that SLURM no longer knows, and that left no result, is lost: file systems lag."""
HOPELESS = ("PartitionTimeLimit", "PartitionNodeLimit", "BadConstraints", "AssocMaxJobsLimit", "ReqNodeNotAvail")
"""Beginnings of the reasons of SLURM for which a task may wait for ever."""
ENDED = "ended by the time limit; raise hydra.launcher.timeout_min, or let it run again: max_num_timeout=3"


def read_queue(number: str) -> dict[str, tuple[str, str]]:
    """Read the state and the reason of each task of an array in SLURM's queue; empty if it knows none."""
    command = ["squeue", "--noheader", "--array", f"--jobs={number}", "--format=%i|%T|%r"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    fields = [line.strip().split("|") for line in answer.stdout.splitlines()]
    return {name: (state, reason) for name, state, reason in fields}


class Call:
    """A call that submitit pickles, and starts again after USR2: results so far are stored."""

    def __init__(self, function: Callable[..., Any], arguments: Sequence[Any]):
        self.function = function
        self.arguments = arguments

    def __call__(self) -> Any:
        """Make the call."""
        return self.function(*self.arguments)

    def checkpoint(self) -> Any:
        """Return what submitit starts after USR2: the same call."""
        from submitit.helpers import DelayedSubmission

        return DelayedSubmission(self)


def do_share(work: Callable[..., Any], items: Sequence[Item]) -> dict[int, Any]:
    """Do a share of the items on the cores of a task, until SLURM sends USR2.

    Returns what ``work(*item)`` returns for each item, by its index.
    """
    with _postponed(signal.SIGUSR2) as is_asked, start_workers() as executor:
        begun = (item for item in items if not is_asked.is_set())
        return dict(map_runs(work, begun, executor, total=len(items), ahead=choose_ahead(executor)))


@contextmanager
def _postponed(number: int) -> Iterator[threading.Event]:
    """Postpone the handler of a signal to the end of the block, which an event asks to end soon."""
    is_asked = threading.Event()
    handler = signal.signal(number, lambda *_: is_asked.set())
    try:
        yield is_asked
    finally:
        signal.signal(number, handler)
    if is_asked.is_set() and callable(handler):
        handler(number, None)


class Tasks(Executor):
    """Submits calls as tasks of SLURM, or as processes of this machine for a trial.

    Args:
        cluster: ``slurm`` or ``local``.
        folder: of submitit's own files and of the logs of tasks.
        options: of submitit, such as ``timeout_min``.

    Raises:
        CmacexpError: submitit does not take them, or there is no SLURM.
    """

    def __init__(self, cluster: str, folder: str, options: Mapping[str, Any]):
        import submitit

        timeouts = {key: value for key, value in options.items() if key == f"{cluster}_max_num_timeout"}
        try:
            self._executor = submitit.AutoExecutor(folder, cluster=cluster, **timeouts)
            self._executor.update_parameters(**{key: value for key, value in options.items() if key not in timeouts})
        except (RuntimeError, TypeError, NameError) as error:
            raise CmacexpError(f"hydra/launcher=submitit_{cluster}: {str(error).splitlines()[0]}") from None
        self.is_slurm = cluster == "slurm"
        self._submitted = SimpleQueue[tuple[Future[Any], Call]]()
        self._jobs = dict[Future[Any], Any]()
        self._seen = dict[Future[Any], float]()
        """When a task was last known to SLURM, s."""
        self._ended = threading.Event()
        self._warned = set[str]()
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit a call; its future runs once SLURM has started the task, and ends with ChildProcessError if lost."""
        future = Future[Any]()
        self._submitted.put((future, Call(fn, args)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Cancel the tasks that have not ended, and say so."""
        self._ended.set()
        self._watcher.join()
        if self._jobs:
            for job in self._jobs.values():
                job.cancel(check=False)
            print_line(f"cancelled {len(self._jobs)} tasks of {self._name(self._jobs.values())}", error=True)

    def __exit__(self, *raised: object) -> None:
        """Cancel what has not ended."""
        self.shutdown()

    def _name(self, jobs: Iterable[Any]) -> str:
        numbers = sorted({str(job.job_id).partition("_")[0] for job in jobs})
        return f"SLURM job {', '.join(numbers)}" if self.is_slurm else "this machine"

    def _watch(self) -> None:
        """Start what is submitted, and end futures whose tasks have ended, until the executor ends."""
        states = dict[str, tuple[str, str]]()
        read_at = 0.0
        while not self._ended.wait(INTERVAL):
            self._start_tasks()
            if self.is_slurm and self._jobs and time.monotonic() > read_at + QUEUE_INTERVAL:
                numbers = sorted({str(job.job_id).partition("_")[0] for job in self._jobs.values()})
                states = read_queue(",".join(numbers))
                read_at = time.monotonic()
            for future, job in [*self._jobs.items()]:
                self._update(future, job, states)

    def _start_tasks(self) -> None:
        """Start the tasks that have been submitted since the last look, as one array."""
        futures = list[Future[Any]]()
        calls = list[Call]()
        while not self._submitted.empty():
            future, call = self._submitted.get()
            if not future.cancelled():
                futures.append(future)
                calls.append(call)
        if not futures:
            return
        try:
            with self._executor.batch():
                jobs = [self._executor.submit(call) for call in calls]
        except Exception as error:  # of sbatch: its message is the last line
            for future in futures:
                future.set_exception(CmacexpError(f"sbatch: {str(error).strip().splitlines()[-1]}"))
            return
        self._jobs |= dict(zip(futures, jobs, strict=True))
        self._seen |= dict.fromkeys(futures, time.monotonic())
        logs = Path(jobs[0].paths.folder).parent
        print_line(f"submitted {len(jobs)} tasks to {self._name(jobs)}; logs: {logs}", error=True)

    def _update(self, future: Future[Any], job: Any, states: Mapping[str, tuple[str, str]]) -> None:
        """End a future whose task has left a result or is lost; say why a task waits that may wait for ever."""
        name = str(job.job_id)
        now = time.monotonic()
        state, reason = states.get(name, ("" if self.is_slurm else "RUNNING", ""))
        if job.paths.result_pickle.exists() or (not self.is_slurm and job.done()):
            self._end(future, job)
        elif state:
            self._seen[future] = now
            if state == "RUNNING" and not future.running():
                future.set_running_or_notify_cancel()
            if reason.startswith(HOPELESS) and reason not in self._warned:
                self._warned.add(reason)
                print_line(f"warning: SLURM lets task {name} wait: {reason}; ask for less, or Ctrl-C", error=True)
        elif now > self._seen[future] + PATIENCE:
            self._lose(future, job, "was cancelled, or its node failed")

    def _end(self, future: Future[Any], job: Any) -> None:
        from submitit.core.utils import FailedJobError, UncompletedJobError

        try:
            result = job.result()
        except (FailedJobError, UncompletedJobError) as error:
            self._lose(future, job, _explain(str(error)))
        else:
            del self._jobs[future]
            future.set_result(result)

    def _lose(self, future: Future[Any], job: Any, reason: str) -> None:
        del self._jobs[future]
        text = f"task {job.job_id} {reason}; results so far are kept; log: {job.paths.stderr}"
        future.set_exception(ChildProcessError(text))


def _explain(message: str) -> str:
    """Explain in one line why a task failed: by the last line of the traceback, which stands between dashes."""
    trace = message.split("\n---")[1] if message.count("\n---") > 1 else message
    return ENDED if "timed-out" in trace else f"failed: {trace.strip().splitlines()[-1]}"


def is_restarted() -> bool:
    """Return whether SLURM has started this task before, so that some results of it may be stored."""
    return os.environ.get("SLURM_RESTART_COUNT", "0") != "0"
