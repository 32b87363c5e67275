"""All metrics in the order of their columns; terminal, reports, sweep tables, `optimize` and docs read this alone."""

from typing import Any

from cmacexp.metrics.block import Block
from cmacexp.metrics.body import BODY_METRICS, ESTIMATE_METRICS
from cmacexp.metrics.drift import LEARNING
from cmacexp.metrics.leg import FORCE, SPATIAL, TORQUE, TRACKING
from cmacexp.metrics.memory import MEMORY_METRICS
from cmacexp.metrics.metric import NEITHER, Metric, MetricDisplay

OF_A_CYCLE: dict[str, Metric[Block]] = {**TRACKING, **FORCE, **TORQUE}
"""Those that follow from the trace of one cycle."""
LEG_METRICS: dict[str, Metric[Any]] = {**OF_A_CYCLE, **LEARNING, **MEMORY_METRICS}
"""Columns of ``metrics.parquet`` after ``cycle`` and ``leg``; of a robot those of SPATIAL follow."""
ALL_METRICS: dict[str, Metric[Any]] = {**TRACKING, **SPATIAL, **LEG_METRICS, **BODY_METRICS, **ESTIMATE_METRICS}
"""All of these, and those of ``body_metrics.parquet``."""
SHOWN: dict[str, MetricDisplay] = {name: metric.shown for name, metric in ALL_METRICS.items() if metric.shown}
"""How metrics appear in tables and figures."""
MAIN: dict[str, MetricDisplay] = {name: shown for name, shown in SHOWN.items() if shown.main}
"""The columns of tables of main metrics."""
JUDGED: dict[str, MetricDisplay] = {
    name: shown for name, shown in MAIN.items() if ALL_METRICS[name].better != NEITHER
}
"""The main metrics of which one direction is better."""
RANKED = [name for name in SHOWN if ALL_METRICS[name].better != NEITHER]
"""Metrics of which the table of a sweep has the best value."""
