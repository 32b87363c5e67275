"""The clock of a log: rows in order, each once, at one rate, without holes; every change becomes a note."""

from dataclasses import replace
from typing import Any

import numpy as np

from cmacexp.addons.gap.log import KEY, Log
from cmacexp.addons.gap.outliers import mend_angles, mend_repeats
from cmacexp.addons.gap.times import RATES
from cmacexp.errors import BadInput, require
from cmacexp.typing import Array, Counts, Mask

SPACING = 1.6
"""Spacing of two rows, relative to the median, above which a log is resampled."""
LONGEST = (0.1, 10.0)
"""Spacing of two rows that cuts a log in pieces: the larger of a time, s, and a multiple of the median."""
MOST_BACK = 0.01
"""Largest share of rows that are older than the row before them; more are several logs in one file."""
MISSING = 3.0
"""Spacing of two rows, relative to the median, above which rows are missing, however much times jitter."""
STEADY = 1e-3
"""Deviation from the median spacing, relative to it, up to which rows count as evenly spaced."""
MOST_EMPTY = 0.05
"""Share of rows without any angle above which these are messages of other topics, and left out."""
MEASURED = ("angle", "velocity", "torque", "orientation")
"""Signals that are interpolated; commands are held from one row to the next."""
COMMANDED = ("command", "command_velocity", "feedforward")


def regularise(log: Log) -> Log:
    """Return a log with rows in order, at one rate, without NaN and holes; ``notes`` say what was changed.

    Raises BadInput if the rate is that of no robot, if time runs backwards often, or if values are missing for long.
    """
    rows = len(log.time)
    order = np.flatnonzero(np.isfinite(log.time))
    log = _hold_messages(_choose_run(_choose(log, order, "without a time")))
    back = np.count_nonzero(np.diff(log.time) < 0.0)
    require(
        back <= MOST_BACK * len(log.time),
        KEY,
        log.path,
        f"{back} of {len(log.time)} rows are older than the row before them: they are in no order of time, or its "
        "column is another: --names time=NAME",
    )
    if back:
        log = _choose(log, np.argsort(log.time, kind="stable").astype(np.int64), "")
        log = log.note(f"{back} rows were older than the row before them: rows were sorted by time.")
    log = _choose(
        log, np.flatnonzero(np.diff(log.time, prepend=-np.inf) > 0.0), "with the time of the row before them"
    )
    distinct = (
        f"has {len(log.time)} different times in {rows} rows: too short, or the times have too few digits: --rate HZ"
    )
    require(len(log.time) > 2, KEY, log.path, distinct)
    require(
        0.999 * RATES[0] <= 1.0 / log.period <= 1.001 * RATES[1],
        KEY,
        log.path,
        f"has {1.0 / log.period:.3g} rows a second, which robots do not have: say the unit of time, --units time=ms "
        "(or us, ns), or --rate HZ if its times are wrong",
    )
    log = mend_repeats(mend_angles(_fill(log)))
    steps = np.diff(log.time)
    if steps.max() > SPACING * log.period:
        log = _resample(_choose_piece(log))
    return replace(log, time=log.time - log.time[0])


def _choose(log: Log, rows: Counts, why: str) -> Log:
    """Return some rows of a log, with a note of how many others there were; ``why`` says which; empty: none."""
    lost = len(log.time) - len(rows)
    values: dict[str, Any] = {
        key: None if (signal := vars(log)[key]) is None else signal[rows] for key in (*MEASURED, *COMMANDED)
    }
    chosen = replace(log, time=log.time[rows], rows=log.rows[rows] if log.rows.size else rows, **values)
    return chosen.note(f"{lost} rows {why} were left out.") if lost and why else chosen


def _choose_run(log: Log) -> Log:
    """Return the longest run of a log whose time begins anew, such as the episodes of a data set."""
    steps = np.diff(log.time)
    period = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    starts = np.flatnonzero(steps < -max(LONGEST[0], LONGEST[1] * period)) + 1
    if not len(starts):
        return log
    bounds = np.concatenate([[0], starts, [len(log.time)]])
    longest = int(np.diff(bounds).argmax())
    begin, end = bounds[longest : longest + 2]
    return _choose(log, np.arange(begin, end), "").note(
        f"Time begins anew in {len(starts)} places: the longest run is used, rows {begin} to {end - 1} of "
        f"{len(log.time)}."
    )


def _hold_messages(log: Log) -> Log:
    """Return the rows of a log that have angles, if many have none: they are those of other topics, and are held."""
    has_angle = np.isfinite(log.angle).any(axis=1)
    if has_angle.mean() > 1.0 - MOST_EMPTY or not has_angle.any():
        return log
    held: dict[str, Any] = {}
    for key in (*MEASURED, *COMMANDED):
        signal = vars(log)[key]
        if key == "angle" or signal is None:
            continue
        index = np.where(np.isfinite(signal), np.arange(len(signal))[:, None], 0)
        held[key] = np.take_along_axis(signal, np.maximum.accumulate(index, axis=0), axis=0)
    rows = np.flatnonzero(has_angle)
    known = [signal for signal in held.values() if np.isfinite(signal[rows]).any()]
    first = max((int(np.isfinite(signal[rows]).all(axis=1).argmax()) for signal in known), default=0)
    return _choose(replace(log, **held), rows[first:], "").note(
        f"{np.count_nonzero(~has_angle)} of {len(log.time)} rows have no angle: they are of other topics, and held."
    )


def _fill(log: Log) -> Log:
    """Fill values that are not finite from the rows around them; raise BadInput if they miss for too long."""
    longest = max(LONGEST[0], LONGEST[1] * log.period)
    filled: dict[str, Any] = {}
    for key in (*MEASURED, *COMMANDED):
        signal = vars(log)[key]
        missing: Mask = np.zeros((1, 1), dtype=bool) if signal is None else ~np.isfinite(signal)
        for j in np.flatnonzero(missing.any(axis=0)):
            good = np.flatnonzero(~missing[:, j])
            name = key if key == "orientation" else log.column(key, int(j))
            row = int(missing[:, j].argmax())
            place = log.find_row(row)
            edges = log.time[np.unique([0, *good, len(log.time) - 1])]
            if len(good) < 2 or np.diff(edges).max() > longest:
                raise BadInput(
                    KEY,
                    log.path,
                    f"column {name} is {signal[row, j]} in row {place} and {missing[:, j].sum() - 1} others, for "
                    f"more than {longest:.2g} s: cut such rows",
                )
            values = filled.setdefault(key, signal.copy())
            values[:, j] = np.interp(log.time, log.time[good], signal[good, j])
            log = log.note(
                f"Column {name}: {missing[:, j].sum()} missing values were interpolated, first in row {place}."
            )
    return replace(log, **filled)


def _choose_piece(log: Log) -> Log:
    """Return the longest piece of a log between two long holes."""
    holes = np.flatnonzero(np.diff(log.time) > max(LONGEST[0], LONGEST[1] * log.period)) + 1
    if not len(holes):
        return log
    bounds = np.concatenate([[0], holes, [len(log.time)]])
    longest = int(np.diff(bounds).argmax())
    rows = np.arange(bounds[longest], bounds[longest + 1])
    piece = _choose(log, rows, "")
    begin, end = piece.time[[0, -1]] - log.time[0]
    first = log.find_row(int(holes[0]))
    return piece.note(
        f"Rows are missing for long in {len(holes)} places, first before row {first}: the longest piece is used, "
        f"{begin:.3f} to {end:.3f} s, {len(rows)} of {len(log.time)} rows."
    )


def _resample(log: Log) -> Log:
    """Return a log whose rows are spread evenly; if its angles are smoother without the times, only these change.

    Where most rows are one period apart, and only some are missing, the other rows stay as they are.
    """
    steps = np.diff(log.time)
    is_steady = bool(np.median(np.abs(steps - log.period)) < STEADY * log.period)
    span = log.time[-1] - log.time[0]
    count = round(span / log.period) + 1 if is_steady else len(log.time)
    time = log.time[0] + np.linspace(0.0, span, count)
    period = time[1] - time[0]
    spacing = f"Rows are {1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms apart: "

    def interpolate(signal: Array) -> Array:
        return np.stack([np.interp(time, log.time, values) for values in signal.T], axis=1)

    angle = interpolate(log.angle)
    if not is_steady and _measure_roughness(log.angle) < _measure_roughness(angle):
        return _space_evenly(log).note(
            f"{spacing}the times jitter, not the samples: angles are smoother at even times, {1e3 * period:.4g} ms."
        )
    held = np.searchsorted(log.time, time + STEADY * period, side="right") - 1
    values: dict[str, Any] = {
        key: None if (signal := vars(log)[key]) is None else interpolate(signal) if key in MEASURED else signal[held]
        for key in (*MEASURED, *COMMANDED)
    }
    if values["orientation"] is not None:
        values["orientation"] /= np.linalg.norm(values["orientation"], axis=1, keepdims=True)
    nearest = np.searchsorted(log.time, time).clip(0, len(log.time) - 1)
    rows = log.rows[nearest] if log.rows.size else nearest
    return replace(log, time=time, rows=rows, **values).note(f"{spacing}resampled every {1e3 * period:.4g} ms.")


def _space_evenly(log: Log) -> Log:
    """Return a log whose rows are spread evenly, except where some are missing: these are interpolated, or held."""
    steps = np.diff(log.time)
    missing = np.where(steps > MISSING * log.period, np.round(steps / log.period), 1.0)
    index = np.concatenate([[0.0], np.cumsum(missing)])
    every = np.arange(int(index[-1]) + 1, dtype=float)
    held = np.searchsorted(index, every, side="right") - 1
    values: dict[str, Any] = {}
    for key in (*MEASURED, *COMMANDED):
        if (signal := vars(log)[key]) is not None:
            between = [np.interp(every, index, column) for column in signal.T]
            values[key] = np.stack(between, axis=1) if key in MEASURED else signal[held]
    rows = log.rows[held] if log.rows.size else held
    return replace(log, time=np.linspace(log.time[0], log.time[-1], len(every)), rows=rows, **values)


def _measure_roughness(angle: Array) -> float:
    """Return the mean of squared second differences of angles (n, J) over their variance."""
    return float((np.diff(angle, 2, axis=0) ** 2).mean() / max(float(angle.var(axis=0).mean()), 1e-18))
