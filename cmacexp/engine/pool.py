"""A process that owns workers, so that none imports the user's program.

``multiprocessing`` imports the program that starts a worker into it, where a script without a guard would run again.
Here that program is a line of Python. It takes calls from a connection and answers as they end; when
the other end is closed, or its process has ended, it ends its workers at once: the files of runs are whole or absent.
"""

import multiprocessing
import os
import pickle
import signal
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import suppress
from functools import partial
from multiprocessing import connection, forkserver
from threading import Lock, Thread
from typing import Any

PRELOADED = "cmacexp.engine.preload"
"""Imports what workers need."""


def _call(packed: bytes) -> bytes:
    """Make a pickled call in a worker; returns what it returns, pickled."""
    function, arguments = pickle.loads(packed)
    return pickle.dumps(function(*arguments))


def _end_when_asked(ends: Any) -> None:
    """End this worker when its parent has ended or closed the other end of a pipe."""
    parent = multiprocessing.parent_process()
    connection.wait([ends] if parent is None else [ends, parent.sentinel])
    os._exit(1)


def _begin(speaks: Any, ends: Any) -> None:
    """Begin to work; the first worker that ``speaks`` says that it compiles."""
    Thread(target=_end_when_asked, args=(ends,), daemon=True).start()
    if speaks.acquire(block=False):
        from cmacexp.terminal.messages import announce_compiling  # here, because only workers have it already

        announce_compiling()


def _answer(send: Callable[[Any], None], number: int, future: Future[bytes]) -> None:
    """Send the number of a call with its pickled result, or with its error and where that was raised."""
    error = None if future.cancelled() else future.exception()
    if error is not None and error.__cause__ is not None:
        error.add_note(str(error.__cause__))
    send((number, None if error or future.cancelled() else future.result(), error))


def serve(calls: connection.Connection) -> None:
    """Make the calls that come from a connection, after the number of workers, until None comes or it is closed."""
    context: Any = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOADED])
    forkserver.ensure_running()  # what workers need is imported while the user's program starts
    ends, ending = multiprocessing.Pipe(duplex=False)
    sending = Lock()

    def send(answer: Any) -> None:
        with sending, suppress(OSError):
            calls.send(answer)

    size = calls.recv()
    executor = ProcessPoolExecutor(size, context, _begin, (context.Semaphore(1), ends))
    for _ in range(size):
        executor.submit(os.getpid)  # let it start before there is work for it
    try:
        while (call := calls.recv()) is not None:
            number, packed = call
            try:
                executor.submit(_call, packed).add_done_callback(partial(_answer, send, number))
            except BrokenExecutor as error:
                send((number, None, error))
    finally:
        ending.close()
        executor.shutdown(cancel_futures=True)


def main(number: int) -> None:
    """Serve the connection with a file descriptor."""
    for ignored in (signal.SIGINT, signal.SIGUSR2):  # the warning of SLURM reaches all processes of a task
        signal.signal(ignored, signal.SIG_IGN)
    with connection.Connection(number) as calls, suppress(EOFError, OSError):
        serve(calls)
