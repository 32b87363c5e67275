"""Measures of one run in studies that compare many: metrics per cycle over all legs, and how its config differs."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from cmacexp.data.stored_run import StoredRun

if TYPE_CHECKING:
    import pandas as pd

MEANS = ("force_settled", "force_steady_state_error", "feedforward_share")
ROOT_MEAN_SQUARES = ("transfer_rmse_x", "transfer_rmse_y", "force_rmse", "force_rmse_three_feet")


def per_cycle(run: StoredRun) -> "pd.DataFrame":
    """Metrics by cycle, those of several legs pooled as in the terminal's table; with ``tilt_max`` of a body."""
    table = run.metrics
    pooled = table.groupby("cycle")[list(MEANS)].mean()
    for name in ROOT_MEAN_SQUARES:
        pooled[name] = (table[name] ** 2).groupby(table["cycle"]).mean() ** 0.5
    if run.walks:
        pooled["tilt_max"] = run.body_metrics.set_index("cycle")["tilt_max"]
    return pooled


def flat(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A nested config by dotted keys."""
    found: dict[str, Any] = {}
    for key, value in config.items():
        found |= flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return found


def changed(config: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of ``config`` that differ from ``base``, by dotted keys."""
    before = flat(base)
    return {key: value for key, value in flat(config).items() if before.get(key) != value}


def short(value: Any) -> str:
    """A value of a config as the command line takes it."""
    if isinstance(value, list):
        return "[" + ",".join(short(v) for v in value) + "]"
    if value is None:
        return "null"
    return f"{value:.10g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def digits(value: float) -> str:
    """Three figures or so, as tables show a positive number."""
    if value != value:
        return "-"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"


def size_of(number: float) -> str:
    """Bytes as a reader takes them in: ``16 KB``."""
    for unit, factor in (("MB", 2**20), ("KB", 2**10)):
        if number >= factor:
            return f"{number / factor:.3g} {unit}"
    return f"{number:.0f} B"


def listed(names: list[str]) -> str:
    """``a, b and c``; ``none`` of none."""
    return ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else names[0] if names else "none"
