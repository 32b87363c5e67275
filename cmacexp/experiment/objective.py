"""``optimize=NAME``: the number that a job of a sweep returns to a sweeper that searches."""

import math

from cmacexp.errors import BadInput, suggest
from cmacexp.metrics.metric import LARGE, NEAR_ZERO
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.metrics.tracking import SPATIAL
from cmacexp.report.run_summary import RunSummary


def list_metrics(kind: str) -> list[str]:
    """Names of the metrics that a kind of machine has; only legs of a robot move in space."""
    return [name for name in ALL_METRICS if kind == "robot" or name not in SPATIAL]


def check_metric(name: str | None, kind: str) -> None:
    """Check that ``optimize`` names a metric that the ``kind`` of machine has; raises BadInput."""
    known = list_metrics(kind)
    if name is not None and name not in known:
        raise BadInput("optimize", name, f"choose from {', '.join(known)}, or null{suggest(name, known)}")


def read_objective(name: str, run: RunSummary) -> float:
    """The value of a metric in the last whole cycle, pooled over the legs, in SI units.

    A metric that is best near zero counts without its sign. A run that fell, diverged or failed, or that does not
    define the metric, has the worst value: -inf for a metric that is better large, else inf.
    """
    better = ALL_METRICS[name].better
    value = run.final(name) if run.status == "completed" else math.nan
    if math.isnan(value):
        return -math.inf if better == LARGE else math.inf
    return abs(value) if better == NEAR_ZERO else value
