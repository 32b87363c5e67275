"""Traces made up column by column, and their metrics."""

import numpy as np
import pyarrow as pa

from cmacexp.data.signals import LEG_SIGNALS, SPATIAL_SIGNALS, make_schema, select_signals
from cmacexp.data.trace import Trace
from cmacexp.metrics.score import RunScorer

PERIOD = 0.1
NOTHING = float("nan")


def phases(text):
    """Phase and progress of each sample of a cycle that repeats, ``"TTSSSS"``."""
    after = len(text) if len(set(text)) == 1 else next(k for k in range(len(text)) if text[k] != text[k - 1])
    turned = text[after:] + text[:after]
    lengths = {phase: text.count(phase) for phase in "TS"}
    since = [turned[: k + 1].count(turned[k]) - 1 for k in range(len(text))]
    progress = [n / lengths[phase] for n, phase in zip(since, turned, strict=True)]
    return [{"T": "transfer", "S": "support"}[p] for p in text], np.roll(progress, after)


def make_trace(text, rows=None, legs=1, in_space=False, **columns):
    """A trace of one or more cycles of ``text``; a column is a value, or one for each step and leg."""
    rows = rows or len(text)
    schema = make_schema(select_signals((*LEG_SIGNALS, *SPATIAL_SIGNALS) if in_space else LEG_SIGNALS))
    values = {"force": 0.0, "force_desired": 0.0} | {f"{axis}{of}": 0.0 for axis in "xyz" for of in ("", "_desired")}
    values |= {f"tau_{part}_{n}": 0.0 for part in ("feedback", "feedforward", "force") for n in (1, 2, 3)}
    values |= {f"q{n}{of}": 0.0 for n in (1, 2, 3) for of in ("", "_desired")} if in_space else {}
    phase, progress = (np.resize(values, rows) for values in phases(text))
    values |= {"step": np.arange(rows), "time": np.arange(rows) * PERIOD, "progress": progress, "phase": phase}
    values |= {"cycle": np.arange(rows) // len(text) + 1, "leg": np.tile(np.arange(1, legs + 1), (rows, 1))}
    values |= columns
    arrays = []
    for field in schema:
        value = np.asarray(values.get(field.name, NOTHING))
        whole = np.broadcast_to(value if value.ndim == 2 else value.reshape(-1, 1), (rows, legs)).ravel()
        arrays.append(pa.array(whole.tolist(), pa.string()).dictionary_encode().cast(field.type)
                      if field.name == "phase" else pa.array(whole, field.type))  # fmt: skip
    return Trace(pa.Table.from_arrays(arrays, schema=schema))


def score(trace, steps_per_cycle):
    """Metrics of a trace: a table of one row per cycle and leg, and one of the body."""
    scorer = RunScorer(steps_per_cycle)
    scorer.add(trace)
    return scorer.scores


def measure(text, **columns):
    """Metrics of each cycle and leg, by name."""
    table = score(make_trace(text, **columns), len(text)).legs
    return {name: table.column(name).to_numpy() for name in table.column_names}
