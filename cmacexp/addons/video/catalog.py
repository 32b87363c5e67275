"""A catalogue of recordings: Rerun's server and its table of runs, with a column per config key and metric."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import rerun.blueprint.table as rrt
from rerun.catalog import DatasetEntry
from rerun.server import Server

from cmacexp.data.run import Run
from cmacexp.data.tables import RECORDING_FILE
from cmacexp.errors import BadRun
from cmacexp.metrics.registry import ALL_METRICS, MAIN
from cmacexp.metrics.swept import find_swept
from cmacexp.recording.viewer import HOST
from cmacexp.recording.write import ensure_recording
from cmacexp.terminal.output import print_line, show_activity

DATASET = "runs"
NAME_COLUMN = "property:RecordingInfo:name"


def build_recordings(runs: Sequence[Run], rebuild: bool) -> tuple[list[Run], list[str]]:
    """Build missing recordings, or with ``rebuild`` all of them.

    Returns the runs that can be shown, and the errors of the others. Raises BadRun if no run can be shown.
    """
    ready, faults = [], []
    for run in runs:
        try:
            ensure_recording(run, rebuild)
            ready.append(run)
        except BadRun as error:
            faults.append(str(error))
    BadRun.unless(ready, "; ".join(faults))
    return ready, faults


def show_table(runs: Sequence[Run], rebuild: bool, show: Callable[[str], int]) -> int:
    """Show runs as a table whose rows open their recordings, and return the exit code of the viewer.

    Missing recordings are built, with ``rebuild`` all. ``show`` opens an address in the viewer and returns its exit
    code. Raises BadRun.
    """
    with show_activity(f"building missing recordings of {len(runs)} runs"):
        ready, faults = build_recordings(runs, rebuild)
    for fault in faults:
        print_line(f"left out: {fault}", error=True)
    keys = find_swept(ready).all_keys
    with serve_catalog(ready, keys) as (address, _):
        differing = ", ".join(keys) or "nothing in which they differ"
        print_line(f"{len(ready)} of {len(runs)} runs in a table, by {differing}")
        return show(address)


def _set_columns(entry: DatasetEntry, keys: Sequence[str]) -> None:
    """Set the visible columns of the table: name, config ``keys``, status, main metrics; the others are hidden."""
    present = entry.segment_table().schema().names
    sources = {
        NAME_COLUMN: "run",
        **{f"property:config:{re.sub(r'[^A-Za-z0-9_]', '_', key)}": key for key in keys},
        "property:run:status": "status",
        **{f"property:metrics:{name}": f"{name} {ALL_METRICS[name].unit}".rstrip() for name in MAIN},
    }
    columns = [
        *(rrt.Column(source, name=name) for source, name in sources.items() if source in present),
        *(rrt.Column(source, visible=False) for source in present if source not in sources),
    ]
    with TemporaryDirectory() as folder:
        path = Path(folder, "table.rbl")
        blueprint = rrt.TableBlueprint(table_layout=rrt.TableLayout(columns=columns), sort_by=NAME_COLUMN)
        blueprint.save(DATASET, path)
        entry.register_blueprint(path.as_uri(), segment_table=True)


@contextmanager
def serve_catalog(runs: Sequence[Run], keys: Sequence[str]) -> Iterator[tuple[str, DatasetEntry]]:
    """Serve the recordings of runs as one data set on this machine, with the config ``keys`` as first columns.

    Yields the address of the table and the data set. Raises BadRun if two recordings have the same id.
    """
    with Server(host=HOST, datasets={DATASET: [run.folder / RECORDING_FILE for run in runs]}) as server:
        entry = server.client().get_dataset(DATASET)
        if (accepted := len(entry.segment_ids())) < len(runs):
            raise BadRun(
                f"{runs[0].folder}: of {len(runs)} recordings the server takes {accepted}, since copies share an id; "
                "--rebuild builds them anew"
            )
        _set_columns(entry, keys)
        yield f"{server.url()}/entry/{entry.id}", entry
