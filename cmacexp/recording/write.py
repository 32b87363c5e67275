"""Write the recording of a run, or of several side by side, from their traces: ``recording.rrd``."""

import hashlib
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import RrdReader

from cmacexp.data.files import write_atomically
from cmacexp.data.run import Run
from cmacexp.data.tables import RECORDING_FILE
from cmacexp.data.version import __version__
from cmacexp.data.window import Window, make_window, read_cycles
from cmacexp.entry_points import load_view
from cmacexp.errors import BadRun, require
from cmacexp.metrics.swept import find_swept, name_runs
from cmacexp.recording.entities import Entities
from cmacexp.recording.layout import KEY, describe_key, make_layout
from cmacexp.recording.run_view import RunView, count_kept
from cmacexp.recording.scene import log_ground, log_machine
from cmacexp.recording.series import EVENTS, SERIES, find_events, list_plots, name_component

MOST_RUNS = 6
"""More side by side have too narrow columns."""
FACTS = "run"
"""The property of a recording that says of which run it is."""


class Options(NamedTuple):
    """What a recording shows."""

    cycles: str | None = None
    """Those that are shown, as typed, such as ``last3``, of cycles that all runs took; None: all."""
    every: int | None = None
    """One step in so many is shown; None: all of a short run, fewer of a long one."""
    meshes: bool = False
    """Whether robots are drawn as their models show them."""
    label: str | None = None
    """Name of a single run; None: that of its folder."""


DEFAULT = Options()


def _list_facts(run: Run) -> dict[str, object]:
    """How a run ended, and what wrote it and its recording."""
    manifest = run.manifest
    return {
        **{name: manifest[name] for name in ("status", "cause", "seed", "steps", "config_hash", "git_commit")},
        "overrides": " ".join(manifest["overrides"] or ()) or None,
        "version": manifest["versions"].get("cmacexp"),
        "recorded_by": __version__,
    }


def _fits_arrow(value: object) -> bool:
    return isinstance(value, float | str) or (isinstance(value, int) and -(2**63) <= value < 2**63)


def _send_facts(recording: rr.RecordingStream, run: Run, root: str) -> None:
    """How a run ended, its config by dotted keys, and the metrics of its last whole cycle, legs pooled, in SI units.

    A catalogue of recordings can be filtered by them. Of several runs in one recording each property begins with the
    root of its entities.
    """
    last = {name: run.final(name) for name in run.pooled}
    metrics = {name: value for name, value in last.items() if math.isfinite(value)}
    for name, values in {FACTS: _list_facts(run), "config": run.settings, "metrics": metrics}.items():
        known = {
            key: pa.array([value if _fits_arrow(value) else str(value)])
            for key, value in values.items()
            if value is not None
        }
        if known:
            recording.send_property(root.replace("/", "_") + name, rr.AnyValues(**known))


def _log_series(entities: Entities, view: RunView) -> None:
    """All time series, in single precision."""
    columns = []
    for path, plot in list_plots(view).items():
        values = pa.array(np.stack([line.values for line in plot.lines], axis=1).astype(np.float32).ravel())
        name, owner = name_component(path), path.partition("/")[0]
        # rr.AnyValues.columns makes the same, but looks at each number.
        columns.append(
            rr.ComponentColumn(rr.ComponentDescriptor(name, archetype=owner), rr.AnyBatchValue(name, values))
        )
    entities.send_columns(SERIES, columns)


def _log_events(entities: Entities, view: RunView) -> None:
    """The moments as a log, each with its time, which the viewer goes to when it is clicked."""
    found = find_events(view)
    texts = [f"{view.time[row]:.3f} s  {text}" for row, text in found]
    entities.send_columns(EVENTS, rr.TextLog.columns(text=texts), rows=np.array([row for row, _ in found]))


def is_current(run: Run) -> bool:
    """Whether a run has its recording, whatever it shows: made from this run, by this version, and readable."""
    path, facts = run.folder / RECORDING_FILE, _list_facts(run)
    if path.is_symlink() or not path.is_file():
        return False
    try:
        chunks = RrdReader(path).stream().filter(content=f"/__properties/{FACTS}").to_chunks()
        rows = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]
    except RuntimeError:  # of a file that is damaged, or is none of rerun's
        return False
    names = ("config_hash", "steps", "recorded_by")
    return any(all(row.get(name) == [facts[name]] for name in names) for row in rows)


def _make_views(runs: Sequence[Run], windows: Sequence[Window], options: Options) -> list[RunView]:
    """The views of runs; of several each has a root of its own, and a label that tells it from the others."""
    if len(runs) == 1:
        names, roots = [options.label or runs[0].folder.resolve().name], [""]
    else:
        names = name_runs(runs, find_swept(runs).all_keys)
        roots = [f"{n}_{re.sub('[^A-Za-z0-9.-]+', '_', name)}/" for n, name in enumerate(names, start=1)]
    views = [
        RunView(run, run.read_trace(window.cycles, window.every), name, root, options.meshes)
        for run, window, name, root in zip(runs, windows, names, roots, strict=True)
    ]
    require(
        max(view.time[0] for view in views) <= min(view.time[-1] for view in views),
        "--cycles",
        windows[0].first,
        "no time is in these cycles of all runs; choose earlier ones",
    )
    return views


def _make_id(name: str, runs: Sequence[Run]) -> str:
    """An id that other runs and other views of these do not have: a catalogue drops what has the id of another."""
    identity = (name, *(f"{run.manifest['config_hash']} {run.folder.resolve()}" for run in runs))
    return hashlib.sha256("\n".join(identity).encode()).hexdigest()[:32]


def make_recording(runs: Sequence[Run], options: Options) -> tuple[rr.RecordingStream, str]:
    """A recording of a run, or of several side by side, that goes nowhere yet, and a description of it.

    Raises:
        BadInput: an option does not fit the runs.
        BadRun: a run has nothing to show, or they are too many.
    """
    BadRun.unless(
        len(runs) <= MOST_RUNS,
        f"{len(runs)} runs: at most {MOST_RUNS} go side by side; name the folders of those to compare",
    )
    kept = [count_kept(run) for run in runs]
    cycles = None if options.cycles is None else read_cycles(options.cycles, min(map(max, kept)))
    windows = [make_window(steps, cycles, options.every, sharing=len(runs)) for steps in kept]
    views = _make_views(runs, windows, options)
    before = f"{runs[0].config['scenario']} " if len(runs) == 1 else ""
    name = before + " | ".join(f"{view.label}, {window}" for view, window in zip(views, windows, strict=True))
    name += ", with meshes" if options.meshes else ""
    recording = rr.RecordingStream("cmacexp", recording_id=_make_id(name, runs))
    recording.send_blueprint(make_layout(views))
    recording.send_recording_name(name)
    recording.log(KEY, rr.TextDocument(describe_key(views), media_type="text/markdown"), static=True)
    for run, view in zip(runs, views, strict=True):
        _send_facts(recording, run, view.root)
        entities = Entities(recording, view)
        log_machine(entities, view)
        log_ground(entities, view)
        _log_series(entities, view)
        _log_events(entities, view)
        if options.meshes:
            load_view("meshes")(entities, view, run)
    return recording, name + ("; --every 1 shows all" if max(window.every for window in windows) > 1 else "")


def write_recording(runs: Sequence[Run], path: Path, options: Options = DEFAULT) -> str:
    """Write a recording to a file, whose folder exists, whole or not at all; returns a description of it.

    Raises as :func:`make_recording`, and OSError.
    """
    recording, description = make_recording(runs, options)
    # From memory: on a full disk rerun's own writer stops without an error, and flushing waits for ever.
    content = recording.memory_recording().drain_as_bytes()
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)
    return description


def ensure_recording(run: Run, anew: bool = False) -> str:
    """Build the recording of a run where :func:`is_current` says that it has none, or ``anew``; a description of it.

    Raises as :func:`make_recording`, and OSError.
    """
    if is_current(run) and not anew:
        return "as it was built; --rebuild builds it anew"
    return write_recording([run], run.folder / RECORDING_FILE)
