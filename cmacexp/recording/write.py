"""Write ``recording.rrd`` from a trace."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from cmacexp.data.folder import write_atomically
from cmacexp.data.manifest import Manifest
from cmacexp.data.tables import read_traces, steps_by_cycle
from cmacexp.recording.blueprint import layout
from cmacexp.recording.entities import Entities
from cmacexp.recording.events import log_events
from cmacexp.recording.facts import Facts, make_facts, send_facts
from cmacexp.recording.ground import log_ground
from cmacexp.recording.key import KEY, describe_key
from cmacexp.recording.run_view import RunView, make_view
from cmacexp.recording.scene import log_machine
from cmacexp.recording.series import log_series
from cmacexp.recording.window import Window, make_window


class _NoPandas(MetaPathFinder):
    """Reports pandas as missing while it is not imported yet."""

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


class RunEntry(NamedTuple):
    """A run that a recording shows."""

    view: RunView
    facts: Facts
    """By the name of the property that holds them."""


def write_views(
    entries: Sequence[RunEntry],
    blueprint: rrb.Blueprint,
    name: str,
    path: Path,
    texts: Mapping[str, str] | None = None,
) -> None:
    """Write runs into one recording, whole or not at all.

    Args:
        entries: the runs, each below its own root.
        blueprint: how the viewer lays them out.
        name: of the recording in the viewer.
        path: of the ``.rrd`` file.
        texts: Markdown by the path of its entity, beside the key.
    """
    texts = {KEY: describe_key([entry.view for entry in entries]), **(texts or {})}
    recording = rr.RecordingStream("cmacexp", recording_id=name)
    # In memory first: on a full disk rerun's own writer stops without an error, and flushing waits for ever.
    memory = recording.memory_recording()
    recording.send_blueprint(blueprint)
    recording.send_recording_name(name)
    for entity, text in texts.items():
        recording.log(entity, rr.TextDocument(text, media_type="text/markdown"), static=True)
    for view, facts in entries:
        send_facts(recording, view.root, facts)
        entities = Entities(recording, view)
        log_machine(entities, view)
        log_ground(entities, view)
        log_series(entities, view)
        log_events(entities, view)
    with write_atomically(path) as temporary:
        temporary.write_bytes(memory.drain_as_bytes())


def read_entry(folder: Path, manifest: Manifest, window: Window, label: str, root: str = "") -> RunEntry:
    """A run as a recording shows it.

    Args:
        folder: of the run, whose trace has at least one step.
        manifest: how it ended, and of what config.
        window: the steps that are shown.
        label: name of the run.
        root: prefix of the paths of its entities.
    """
    traces = read_traces(folder, window.cycles, window.every)
    return RunEntry(make_view(traces, manifest, window, label, root), make_facts(folder, manifest))


def write_recording(
    folder: Path,
    manifest: Manifest,
    path: Path,
    *,
    label: str | None = None,
    window: Window | None = None,
    names: Sequence[str] | None = None,
) -> str:
    """Write the Rerun view of a run, whole or not at all.

    Args:
        folder: of the run, whose trace has at least one step.
        manifest: how it ended, and of what config.
        path: of the ``.rrd`` file.
        label: name of the run; None: that of the folder of ``path``.
        window: the steps that are shown; None: all cycles, thinned if the run is long.
        names: of the panels to show; None: the default ones.

    Returns:
        The name of the recording, which describes its content.
    """
    with _pandas_left_out():
        window = window or make_window(steps_by_cycle(folder))
        entry = read_entry(folder, manifest, window, label or path.parent.name)
        name = f"{manifest['config']['scenario']} {entry.view.label}, {window}"
        write_views([entry], layout(entry.view, names), name, path)
    return name


def read_name(path: Path) -> str | None:
    """The name that a recording was given; None if it cannot be read."""
    try:
        chunks = RrdReader(path).stream().filter(content="/__properties").to_chunks()
    except RuntimeError:
        return None
    rows = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]
    return next((row["RecordingInfo:name"][0] for row in rows if row.get("RecordingInfo:name")), None)
