"""A catalogue of recordings: Rerun's server, and its table of runs, a column for each setting and metric."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import rerun.blueprint.table as rrt
from rerun.catalog import DatasetEntry
from rerun.server import Server

from cmacexp.errors import BadRun
from cmacexp.metrics.registry import ALL_METRICS, MAIN

DATASET = "runs"
NAME_COLUMN = "property:RecordingInfo:name"


def _list_columns(present: Sequence[str], keys: Sequence[str]) -> list[rrt.Column]:
    """The columns of the table: first what distinguishes the runs, then the main metrics; the others can be shown."""
    sources = {NAME_COLUMN: "run", **{f"property:config:{re.sub(r'[^A-Za-z0-9_]', '_', key)}": key for key in keys}}
    sources["property:run:status"] = "status"
    sources |= {f"property:metrics:{name}": f"{name} {ALL_METRICS[name].unit}".rstrip() for name in MAIN}
    shown = [rrt.Column(source, name=name) for source, name in sources.items() if source in present]
    return [*shown, *(rrt.Column(source, visible=False) for source in present if source not in sources)]


def _set_columns(runs: DatasetEntry, keys: Sequence[str]) -> None:
    columns = _list_columns(runs.segment_table().schema().names, keys)
    table = rrt.TableBlueprint(table_layout=rrt.TableLayout(columns=columns), sort_by=NAME_COLUMN)
    with TemporaryDirectory() as folder:
        path = Path(folder, "table.rbl")
        table.save(DATASET, path)
        runs.register_blueprint(path.as_uri(), segment_table=True)


@contextmanager
def serve_catalog(recordings: Sequence[Path], keys: Sequence[str], host: str) -> Iterator[tuple[str, DatasetEntry]]:
    """Serve recordings as one data set, with ``keys`` of the config as first columns; raises BadRun.

    Gives the address of its table, and the data set; ``host`` is the address of this machine that it listens to.
    """
    with Server(host=host, datasets={DATASET: recordings}) as server:
        runs = server.client().get_dataset(DATASET)
        if (taken := len(runs.segment_ids())) < len(recordings):
            reason = f"of {len(recordings)} recordings the server takes {taken}, since copies share an id"
            raise BadRun(f"{recordings[0]}: {reason}; --rebuild builds them anew")
        _set_columns(runs, keys)
        yield f"{server.url()}/entry/{runs.id}", runs
