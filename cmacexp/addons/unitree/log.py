"""The log of a robot, written while it moves: what a killed process leaves lacks a second at most."""

import json
import os
import threading
from collections.abc import Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
import pyarrow as pa

from cmacexp.data.tables import write_table
from cmacexp.errors import BadInput
from cmacexp.typing import Array

LOGGED = ("q", "dq", "tau", "q_des", "dq_des", "tau_ff", "kp", "kd")
"""Prefixes of the columns of a log, before the name of a joint: rad, rad/s, N m, N m/rad and N m s/rad.

:mod:`cmacexp.addons.gap` reads them.
"""
WRITTEN = 1.0
"""Time after which rows are on the disk, s."""


def name_partial(path: Path) -> Path:
    """Return the name of the file that is written while the robot moves."""
    return path.with_name(f"{path.name}.partial")


class Log:
    """States and commands of a robot: a file of rows that grows, and in the end becomes a Parquet file."""

    def __init__(self, path: Path, period: float, joints: Sequence[str]):
        """Begin a log with a row each ``period``, s, and the names of the 12 ``joints`` in its columns."""
        self.path = path
        self._columns = [f"{name}_{joint}" for name in LOGGED for joint in joints]
        self._rows = round(WRITTEN / period)
        self._file = name_partial(path).open("wb")
        self._trouble: OSError | None = None
        self._queue: SimpleQueue[bytes | None] = SimpleQueue()
        self._queue.put(json.dumps({"period": period, "columns": self._columns}).encode() + b"\n")
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()
        self.clear()

    def clear(self) -> None:
        """Forget the rows of this second, which are not written yet."""
        self._chunk = np.zeros((self._rows, len(self._columns)))
        self._filled = 0

    def add(self, *values: Any) -> None:
        """Add a row: the values of LOGGED, each (4, 3) or one number for all joints."""
        row = self._chunk[self._filled].reshape(len(LOGGED), 4, 3)
        for place, value in zip(row, values, strict=True):
            place[...] = value
        self._filled += 1
        if self._filled == self._rows:
            self._queue.put(self._chunk.tobytes())
            self.clear()

    def _write(self) -> None:
        while (rows := self._queue.get()) is not None:
            try:
                self._file.write(rows)
                self._file.flush()
                os.fsync(self._file.fileno())
            except OSError as error:  # a full disk costs only the log
                self._trouble = error

    def close(self) -> None:
        """Write the Parquet file; raise OSError if that, or an earlier write, failed."""
        self._queue.put(self._chunk[: self._filled].tobytes())
        self._queue.put(None)
        self._thread.join()
        self._file.close()
        if self._trouble is not None:
            raise self._trouble
        recover_log(self.path)


def recover_log(path: Path) -> int:
    """Make a log from what a killed run left beside it; return its number of rows.

    Raises BadInput if there is nothing.
    """
    partial = name_partial(path)
    if not partial.is_file():
        raise BadInput("--recover", str(path), f"there is no {partial.name} beside it, which a killed run leaves")
    head, _, data = partial.read_bytes().partition(b"\n")
    about = json.loads(head)
    columns = about["columns"]
    width = len(columns) * 8
    rows: Array = np.frombuffer(data[: len(data) // width * width]).reshape(-1, len(columns))
    values = dict(zip(columns, rows.T, strict=True))
    write_table(pa.table({"time": about["period"] * np.arange(len(rows)), **values}), path)
    partial.unlink()
    return len(rows)
