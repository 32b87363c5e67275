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
"""Most runs side by side; more would have too narrow columns."""
FACTS = "run"
"""Property of a recording that identifies its run."""


class Options(NamedTuple):
    """The options of a recording."""

    cycles: str | None = None
    """Cycles to show, as typed, e.g. ``last3``; they must exist in all runs. None: all."""
    every: int | None = None
    """Thinning: show one step in ``every``; None: all steps of a short run, fewer of a long one."""
    meshes: bool = False
    """True to draw robots with the meshes of their models."""
    label: str | None = None
    """Name of a single run; None: the name of its folder."""


DEFAULT = Options()


def _list_facts(run: Run) -> dict[str, object]:
    """List the properties of a run by which :func:`is_current` and catalogues identify its recording."""
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
    """Send status, config by dotted keys, and metrics of the last complete cycle as properties of the recording.

    Metrics are pooled over the legs, in SI units. A catalogue of recordings can be filtered by these properties. With
    several runs in a recording, the name of each property begins with the root of the entities of its run.
    """
    last = {name: run.final(name) for name in run.pooled}
    metrics = {name: value for name, value in last.items() if math.isfinite(value)}
    for name, values in {FACTS: _list_facts(run), "config": run.settings, "metrics": metrics}.items():
        properties = {
            key: pa.array([value if _fits_arrow(value) else str(value)])
            for key, value in values.items()
            if value is not None
        }
        if properties:
            recording.send_property(root.replace("/", "_") + name, rr.AnyValues(**properties))


def _log_series(entities: Entities, view: RunView) -> None:
    """Log all time series, in single precision."""
    columns = []
    for path, plot in list_plots(view).items():
        values = pa.array(np.stack([line.values for line in plot.lines], axis=1).astype(np.float32).ravel())
        name = name_component(path)
        descriptor = rr.ComponentDescriptor(name, archetype=path.partition("/")[0])
        # rr.AnyValues.columns gives the same result, but checks each number.
        columns.append(rr.ComponentColumn(descriptor, rr.AnyBatchValue(name, values)))
    entities.send_columns(SERIES, columns)


def _log_events(entities: Entities, view: RunView) -> None:
    """Log the events of a run with their times, to which the viewer moves when they are clicked."""
    events = find_events(view)
    texts = [f"{view.time[row]:.3f} s  {text}" for row, text in events]
    entities.send_columns(EVENTS, rr.TextLog.columns(text=texts), rows=np.array([row for row, _ in events]))


def is_current(run: Run) -> bool:
    """Check whether a run has a readable recording that was made from this run by this version, with any options."""
    path = run.folder / RECORDING_FILE
    facts = _list_facts(run)
    if path.is_symlink() or not path.is_file():
        return False
    try:
        chunks = RrdReader(path).stream().filter(content=f"/__properties/{FACTS}").to_chunks()
        rows = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]
    except RuntimeError:  # the file is damaged, or not a recording
        return False
    names = ("config_hash", "steps", "recorded_by")
    return any(all(row.get(name) == [facts[name]] for name in names) for row in rows)


def _make_views(runs: Sequence[Run], windows: Sequence[Window], options: Options) -> list[RunView]:
    """Make the views of runs; several runs get a root each, and labels with the settings in which they differ."""
    if len(runs) == 1:
        names = [options.label or runs[0].folder.resolve().name]
        roots = [""]
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
    """Make an id that is unique to these runs and options, since a catalogue drops recordings with equal ids."""
    identity = (name, *(f"{run.manifest['config_hash']} {run.folder.resolve()}" for run in runs))
    return hashlib.sha256("\n".join(identity).encode()).hexdigest()[:32]


def make_recording(runs: Sequence[Run], options: Options) -> tuple[rr.RecordingStream, str]:
    """Make a recording of a run, or of several side by side, in memory; return it with a description.

    Raises:
        BadInput: an option does not fit the runs.
        BadRun: the trace of a run is empty, or there are more than MOST_RUNS runs.
    """
    BadRun.unless(
        len(runs) <= MOST_RUNS,
        f"{len(runs)} runs: at most {MOST_RUNS} go side by side; name the folders of those to compare",
    )
    kept = [count_kept(run) for run in runs]
    cycles = None if options.cycles is None else read_cycles(options.cycles, min(map(max, kept)))
    windows = [make_window(steps, cycles, options.every, sharing=len(runs)) for steps in kept]
    views = _make_views(runs, windows, options)
    scenario = f"{runs[0].config['scenario']} " if len(runs) == 1 else ""
    name = scenario + " | ".join(f"{view.label}, {window}" for view, window in zip(views, windows, strict=True))
    name += ", with meshes" if options.meshes else ""
    recording_id = _make_id(name, runs)
    # The viewer shows all recordings with the same application id in the layout of the last one.
    recording = rr.RecordingStream(f"cmacexp {recording_id[:8]}", recording_id=recording_id)
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
    """Write a recording to a file atomically; return a description of the recording.

    The folder of the file must exist. Raises the errors of :func:`make_recording`, and OSError.
    """
    recording, description = make_recording(runs, options)
    # Not with Rerun's writer: on a full disk it stops without an error, and flushing it never returns.
    content = recording.memory_recording().drain_as_bytes()
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)
    return description


def ensure_recording(run: Run, rebuild: bool = False) -> str:
    """Build the recording of a run unless it is current, or in any case to ``rebuild`` it; return a description.

    See :func:`is_current`. Raises the errors of :func:`make_recording`, and OSError.
    """
    if is_current(run) and not rebuild:
        return "current, not rebuilt; --rebuild forces it"
    return write_recording([run], run.folder / RECORDING_FILE)
