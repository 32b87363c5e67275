"""``optimize=NAME``: the number that a job of a sweep returns to a sweeper that searches, and which one is best."""

import math
from collections.abc import Sequence
from typing import Any

from cmacexp.data.run import Run
from cmacexp.errors import BadInput, require, suggest
from cmacexp.metrics.leg import SPATIAL
from cmacexp.metrics.metric import LARGE, NEAR_ZERO, NEITHER, MetricDisplay
from cmacexp.metrics.registry import ALL_METRICS, format_number
from cmacexp.terminal.messages import format_folder

DIRECTION, MINIMIZE, MAXIMIZE = "hydra.sweeper.direction", "minimize", "maximize"
"""What a sweeper that searches does with what jobs return, as Optuna calls it."""


def check_metric(name: str | None, kind: str) -> None:
    """Check that ``optimize`` names a metric that the ``kind`` of machine has; raises BadInput."""
    metrics = [other for other in ALL_METRICS if kind == "robot" or other not in SPATIAL]
    if name is not None and name not in metrics:
        raise BadInput("optimize", name, f"choose from {', '.join(metrics)}, or null{suggest(name, metrics)}")


def find_direction(name: str | None, given: Any, searches: bool) -> str | None:
    """Find the direction in which a metric improves: ``minimize`` or ``maximize``; None if it has none.

    Args:
        name: of the metric, None: none. One that is best near zero counts without its sign, and is minimised.
        given: the direction that a user has set, None: none.
        searches: whether a sweeper uses the direction, so that it has to be known.

    Raises:
        BadInput: a sweeper searches without a metric, or for one of which neither direction is better and none is
            given; or ``given`` contradicts the registry of metrics.
    """
    require(
        name is not None or not searches,
        "optimize",
        "null",
        "this sweeper searches: name the metric, e.g. optimize=transfer_rmse_y",
    )
    better = NEITHER if name is None else ALL_METRICS[name].better
    known = None if better == NEITHER else MAXIMIZE if better == LARGE else MINIMIZE
    if given is None and (known or not searches):
        return known
    if given not in ([known] if known else [MINIMIZE, MAXIMIZE]):
        allowed = f"{known}, or left out" if known else f"{MINIMIZE} or {MAXIMIZE}"
        reason = f"optimize={name} is better {better or 'neither small nor large'}"
        raise BadInput(DIRECTION, "null" if given is None else given, f"must be {allowed}: {reason}")
    return str(given)


def read_objective(name: str, run: Run, direction: str | None) -> float:
    """Read the value of a metric in the last whole cycle, pooled over the legs, in SI units.

    A metric that is best near zero counts without its sign. A run that fell, diverged or failed, or that does not
    define the metric, has the worst value: -inf to ``maximize``, else inf.
    """
    value = run.final(name) if run.completed else math.nan
    if math.isnan(value):
        return -math.inf if direction == MAXIMIZE else math.inf
    return abs(value) if ALL_METRICS[name].better == NEAR_ZERO else value


def describe_best(name: str, direction: str, job: Run, swept: Sequence[str]) -> str:
    """Describe the best job of a search: its values of the ``swept`` keys and of the metric, and its folder."""
    if math.isinf(read_objective(name, job, direction)):
        return f"none: no job completed with a value of {name}"
    shown = ALL_METRICS[name].shown or MetricDisplay(name, ALL_METRICS[name].unit)
    named = " ".join([f"#{job.folder.name}", *(f"{key}={job.settings.get(key)}" for key in swept)])
    value = format_number(job.final(name) * shown.factor, shown.unit)
    return f"{named}: {name} = {value}, in {format_folder(job.folder)}"
