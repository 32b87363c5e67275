"""What the terrain studies measure of a walk, and the runs that they share."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from cmacexp.data.stored_run import StoredRun
from pipelines.shared.stats import Spread

if TYPE_CHECKING:
    import pandas as pd


LASTING = [
    "learning.lead=1",
    "gait.load_ramp=0.12",
    "force_control.elasticity=0.001",
    "force_control.admittance=0.001",
]
"""Settings with which the quadruped learns for hundreds of cycles without drift."""


FEEDFORWARDS = {"with CMAC": "cmac", "feedback alone": "none"}


class Measure(NamedTuple):
    """An error over the cycles: its name in tables, the factor from SI units, and its unit."""

    words: str
    factor: float
    unit: str


BODY = {
    "force_rmse_cycle": Measure("force error", 1.0, "N"),
    "transfer_rmse_y": Measure("transfer error y", 1e3, "mm"),
    "tilt_max": Measure("tilt", 1e3, "mrad"),
}


def errors_of(run: StoredRun, names: Mapping[str, Measure]) -> "pd.DataFrame":
    """Errors of each cycle in the units of their measures, pooled over the legs."""
    table = run.metrics
    rooted = [name for name in names if name != "tilt_max"]
    pooled = (table[rooted] ** 2).groupby(table["cycle"]).mean() ** 0.5
    if "tilt_max" in names:
        pooled["tilt_max"] = run.body_metrics.set_index("cycle")["tilt_max"]
    return pooled[list(names)] * [measure.factor for measure in names.values()]


class Walked(NamedTuple):
    """Runs on the same kind of ground."""

    ground: float
    """Spread or slope."""
    runs: int
    walked: int
    """How many completed."""
    force: Spread
    """Force error over the last cycles, N."""
    tilt: Spread
    """Largest tilt over the last cycles, mrad."""
