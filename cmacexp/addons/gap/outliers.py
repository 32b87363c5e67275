"""Angles that were read wrongly: single values, whole turns, and rows that repeat; all are mended and noted."""

from dataclasses import replace

import numpy as np

from cmacexp.addons.gap.log import Log
from cmacexp.typing import Array, Mask

TURN = (1.6 * np.pi, 2.4 * np.pi)
"""Steps from one row to the next that are a turn of a counter, rad."""
SPIKE = 25.0
"""Second difference, over the 99th percentile of the joint, above which a value is an outlier."""
SMOOTH = 0.5 * np.pi
"""Largest other step of an angle that jumps by turns, rad: larger ones are those of another unit."""
LEAST_JUMP = 0.02
"""Least distance of an outlier from its neighbours, relative to the range of the joint."""
LEAST_JOINTS = 2
"""Least number of joints of which all stand still in a row that repeats the one before: one joint may just rest."""
AROUND = 10
"""Rows before and after rows that repeat, with whose steps the jump after them is compared; also most of them."""
LATE = 1.6
"""That jump over the median of these steps."""
MOST = 0.01
"""Share of rows above which values apart from their neighbours are no outliers."""


def mend_repeats(log: Log) -> Log:
    """Return a log without rows in which all joints stand exactly still before they jump: the reader was late there.

    Their angles are interpolated between those around them.
    """
    steps = np.abs(np.diff(log.angle, axis=0)).max(axis=1)
    is_still = steps == 0.0
    if not is_still.any() or is_still.all() or len(log.joints) < LEAST_JOINTS:
        return log
    repeats = np.zeros(len(log.time), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_still, [0]])))
    for begin, end in edges.reshape(-1, 2):
        around = steps[max(0, begin - AROUND) : end + 1 + AROUND]
        usual = np.median(around[around > 0.0])
        if end < len(steps) and end - begin <= AROUND and steps[end] > LATE * usual:
            repeats[begin + 1 : end + 1] = True
    if not repeats.any():
        return log
    kept = np.flatnonzero(~repeats)
    angle = np.stack([np.interp(log.time, log.time[kept], values[kept]) for values in log.angle.T], axis=1)
    count, first = np.count_nonzero(repeats), int(repeats.argmax())
    return replace(log, angle=angle).note(
        f"{count} rows repeat the angles of the row before them while the robot moves, first row "
        f"{log.find_row(first)}: they were interpolated."
    )


def mend_angles(log: Log) -> Log:
    """Return a log without single values apart from both neighbours, and without steps of a turn; notes say so."""
    angle = log.angle.copy()
    notes = list[str]()
    for j in range(angle.shape[1]):
        values = angle[:, j]
        name = log.column("angle", j)
        rows = np.flatnonzero(_is_apart(values))
        if 0 < len(rows) <= MOST * len(values):
            values[rows] = 0.5 * (values[rows - 1] + values[rows + 1])
            notes.append(
                f"Column {name}: {len(rows)} values apart from those before and after them were interpolated, first "
                f"in row {log.find_row(int(rows[0]))} (t = {log.time[rows[0]]:.3f} s)."
            )
        steps = np.abs(np.diff(values))
        turns = (steps > TURN[0]) & (steps < TURN[1])
        if turns.any() and steps[~turns].max(initial=0.0) < SMOOTH:
            values[:] = np.unwrap(values)
            notes.append(f"Column {name} jumps by a turn {np.count_nonzero(turns)} times: it was unwrapped.")
    return replace(log, angle=angle, notes=(*log.notes, *notes)) if notes else log


def _is_apart(values: Array) -> Mask:
    """Return the mask (n,) of values that lie apart from both neighbours, which are near each other."""
    before, after = values[1:-1] - values[:-2], values[2:] - values[1:-1]
    nearer = np.minimum(np.abs(before), np.abs(after))
    usual = np.percentile(np.abs(np.diff(values, 2)), 99.0)
    apart = (np.sign(before) != np.sign(after)) & (
        nearer > max(0.5 * SPIKE * usual, LEAST_JUMP * np.ptp(values), 1e-6)
    )
    apart &= np.abs(before + after) < 0.5 * nearer
    return np.concatenate([[False], apart, [False]])
