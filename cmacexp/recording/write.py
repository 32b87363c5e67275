"""Write ``recording.rrd`` from a trace."""

import hashlib
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib.abc import MetaPathFinder
from pathlib import Path

import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb

from cmacexp.config.describe import flatten_config
from cmacexp.data.folder import write_atomically
from cmacexp.data.hashes import was_written
from cmacexp.data.manifest import Manifest
from cmacexp.data.parquet import read_table
from cmacexp.data.tables import BODY_METRICS_FILE, METRICS_FILE, Scores
from cmacexp.data.trace import read_trace
from cmacexp.metrics.pooling import pool_legs
from cmacexp.recording.blueprint import KEY, describe_key, layout
from cmacexp.recording.entities import Entities
from cmacexp.recording.events import log_events
from cmacexp.recording.ground import log_ground
from cmacexp.recording.meshes import log_meshes, read_shown_model
from cmacexp.recording.run_view import RunView, make_view
from cmacexp.recording.scene import log_machine
from cmacexp.recording.series import log_series
from cmacexp.recording.window import Window


class _NoPandas(MetaPathFinder):
    """Reports pandas as missing while it is not imported yet; None in ``sys.modules`` breaks pyarrow instead."""

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError("left out", name=fullname)


@contextmanager
def _pandas_left_out() -> Iterator[None]:
    """Keep pyarrow from importing pandas, which it does at its first conversion to know a Series if it sees one.

    No Series occurs here, and the import takes a seventh of the time of a run of one leg. pyarrow imports pandas when
    a caller asks for it later.
    """
    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


def _send_facts(recording: rr.RecordingStream, folder: Path, view: RunView) -> None:
    """How a run ended, its config by dotted keys, and the metrics of its last whole cycle, legs pooled, in SI units.

    A catalogue of recordings can be filtered by them. Of several runs in one recording each property begins with the
    root of its entities.
    """
    manifest, body = view.manifest, folder / BODY_METRICS_FILE
    run = {name: manifest.get(name) for name in ("status", "cause", "seed", "steps", "config_hash", "git_commit")}
    run["overrides"] = " ".join(manifest.get("overrides", ())) or None
    run["version"] = manifest.get("versions", {}).get("cmacexp")
    pooled = pool_legs(Scores(read_table(folder / METRICS_FILE), read_table(body) if was_written(body) else None))
    last = {name: float(values[-1]) for name, values in pooled.items() if len(values) and math.isfinite(values[-1])}
    for name, values in {"run": run, "config": flatten_config(view.config), "metrics": last}.items():
        known = {
            key: pa.array([value if isinstance(value, bool | int | float | str) else str(value)])
            for key, value in values.items()
            if value is not None
        }
        if known:
            recording.send_property(view.root.replace("/", "_") + name, rr.AnyValues(**known))


def _make_id(name: str, runs: Mapping[Path, RunView]) -> str:
    """An id that other runs and other views of these do not have: a catalogue drops what has the id of another."""
    identity = (name, *(f"{view.manifest['config_hash']} {folder.resolve()}" for folder, view in runs.items()))
    return hashlib.sha256("\n".join(identity).encode()).hexdigest()[:32]


def write_views(runs: Mapping[Path, RunView], blueprint: rrb.Blueprint, name: str, path: Path) -> None:
    """Write runs, by their folders and each below its own root, into one recording, whole or not at all."""
    recording = rr.RecordingStream("cmacexp", recording_id=_make_id(name, runs))
    # In memory first: on a full disk rerun's own writer stops without an error, and flushing waits for ever.
    memory = recording.memory_recording()
    recording.send_blueprint(blueprint)
    recording.send_recording_name(name)
    key = rr.TextDocument(describe_key(list(runs.values())), media_type="text/markdown")
    recording.log(KEY, key, static=True)
    for folder, view in runs.items():
        _send_facts(recording, folder, view)
        entities = Entities(recording, view)
        log_machine(entities, view)
        if view.meshes:
            log_meshes(entities, view, read_shown_model(folder, view.manifest))
        log_ground(entities, view)
        log_series(entities, view)
        log_events(entities, view)
    with write_atomically(path) as temporary:
        temporary.write_bytes(memory.drain_as_bytes())


def write_recording(
    folder: Path,
    manifest: Manifest,
    path: Path,
    *,
    label: str,
    window: Window,
    meshes: bool = False,
) -> str:
    """Write the Rerun view of a run whose trace has a step, whole or not at all; returns a description of it."""
    with _pandas_left_out():
        traces = read_trace(folder, range(window.first, window.last + 1), window.every)
        view = replace(make_view(traces, manifest, window, label), meshes=meshes)
        name = f"{manifest['config']['scenario']} {view.label}, {window}{', with meshes' if meshes else ''}"
        write_views({folder: view}, layout(view), name, path)
    return name
