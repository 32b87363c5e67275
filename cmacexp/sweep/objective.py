"""``optimize=NAME``: the one number that a job of a sweep gives to a sweeper which searches."""

import difflib
import math

from cmacexp.errors import BadInput
from cmacexp.metrics.body import BODY_METRICS
from cmacexp.metrics.registry import METRICS
from cmacexp.metrics.summary import COLUMNS, NEAR_ZERO
from cmacexp.report.comparison import Job


def check_metric(name: str | None) -> None:
    """Hold ``optimize`` to the metrics that there are.

    Raises:
        BadInput: names the nearest metric and all others.
    """
    names = [*METRICS, *BODY_METRICS]
    if name is not None and name not in names:
        near = difflib.get_close_matches(name, names, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        raise BadInput("optimize", name, f"choose from {', '.join(names)}, or null{meant}")


def _worst(name: str) -> float:
    """What no run is worse than."""
    return -math.inf if name == "feedforward_share" or "margin" in name else math.inf


def value_of(name: str, job: Job) -> float:
    """The value of a metric in the last whole cycle, pooled over the legs, in SI units.

    A metric that is best near zero counts without its sign. A run that fell, diverged or failed, or that does not
    define the metric, is the worst there is: inf where less is better, -inf where more is (margins,
    ``feedforward_share``).

    Args:
        name: of a column of ``metrics.parquet`` or ``body_metrics.parquet``.
        job: as it stands on disk.
    """
    value = job.last.get(name, math.nan) if job.status == "completed" else math.nan
    if math.isnan(value):
        return _worst(name)
    return abs(value) if name in COLUMNS and COLUMNS[name].good == NEAR_ZERO else value
