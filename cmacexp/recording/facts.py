"""Facts of a run as properties of its recording, so that a catalogue of recordings can be filtered by them."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import rerun as rr

from cmacexp.config.difference import flat
from cmacexp.data.hashes import was_written
from cmacexp.data.manifest import Manifest
from cmacexp.data.parquet import read_table
from cmacexp.data.tables import BODY_METRICS, METRICS, Scores
from cmacexp.metrics.pooling import pool_legs

Facts = dict[str, dict[str, Any]]
"""Values by property and name."""
SIMPLE = (bool, int, float, str)


def _last_metrics(folder: Path) -> dict[str, float]:
    """The metrics of the last whole cycle, legs pooled, in SI units; without undefined ones."""
    body = folder / BODY_METRICS
    pooled = pool_legs(Scores(read_table(folder / METRICS), read_table(body) if was_written(body) else None))
    return {name: float(values[-1]) for name, values in pooled.items() if len(values) and math.isfinite(values[-1])}


def make_facts(folder: Path, manifest: Manifest) -> Facts:
    """What is known of a run: how it ended, its config by dotted keys, and the metrics of its last whole cycle.

    Args:
        folder: of the run.
        manifest: of the run.
    """
    run = {name: manifest.get(name) for name in ("status", "cause", "seed", "steps", "config_hash", "git_commit")}
    run["version"] = manifest.get("versions", {}).get("cmacexp")
    return {"run": run, "config": flat(manifest["config"]), "metrics": _last_metrics(folder)}


def _component(value: Any) -> pa.Array:
    """A value as a column of one row; of lists and the like their text."""
    return pa.array([value if isinstance(value, SIMPLE) else str(value)])


def send_facts(recording: rr.RecordingStream, root: str, facts: Mapping[str, Mapping[str, Any]]) -> None:
    """Send facts as properties; of several runs in one recording each begins with the root of its entities."""
    for name, values in facts.items():
        known = {key: _component(value) for key, value in values.items() if value is not None}
        if known:
            recording.send_property(root.replace("/", "_") + name, rr.AnyValues(**known))
