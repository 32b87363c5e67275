"""Facts of a run as properties of its recording, so that a catalogue of recordings can be filtered by them."""

import math
from pathlib import Path

import pyarrow as pa
import rerun as rr

from cmacexp.config.difference import flat
from cmacexp.data.hashes import was_written
from cmacexp.data.parquet import read_table
from cmacexp.data.tables import BODY_METRICS, METRICS, Scores
from cmacexp.metrics.pooling import pool_legs
from cmacexp.recording.run_view import RunView

SIMPLE = (bool, int, float, str)


def _last_metrics(folder: Path) -> dict[str, float]:
    """The metrics of the last whole cycle, legs pooled, in SI units; without undefined ones."""
    body = folder / BODY_METRICS
    pooled = pool_legs(Scores(read_table(folder / METRICS), read_table(body) if was_written(body) else None))
    return {name: float(values[-1]) for name, values in pooled.items() if len(values) and math.isfinite(values[-1])}


def send_facts(recording: rr.RecordingStream, folder: Path, view: RunView) -> None:
    """Send how a run ended, its config by dotted keys, and the metrics of its last whole cycle.

    Of several runs in one recording each property begins with the root of its entities.
    """
    manifest = view.manifest
    run = {name: manifest.get(name) for name in ("status", "cause", "seed", "steps", "config_hash", "git_commit")}
    run["version"] = manifest.get("versions", {}).get("cmacexp")
    for name, values in {"run": run, "config": flat(view.config), "metrics": _last_metrics(folder)}.items():
        known = {
            key: pa.array([value if isinstance(value, SIMPLE) else str(value)])
            for key, value in values.items()
            if value is not None
        }
        if known:
            recording.send_property(view.root.replace("/", "_") + name, rr.AnyValues(**known))
