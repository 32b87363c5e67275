"""What the study of long learning measures in a run: how small its errors get, how long they stay so, how it ends."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.config.compose import compose_config
from cmacexp.data.stored_run import StoredRun
from cmacexp.stability import predicted_growth
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.measured import growth_over, stretch
from cmacexp.typing import Array

ROUNDING = 1e-9
"""Part of its largest value below which the change of the feedback has no meaning."""
NEAR = 100
"""Cycles at the end of a run whose median is its final error."""


@dataclass(frozen=True)
class Long:
    """One run of many cycles."""

    rule: str
    lead: str
    delay: int
    seed: int
    config: dict[str, Any]
    status: str
    asked: int
    """Cycles asked for."""
    x: Array
    """(cycles,): transfer error along x in each whole cycle, RMS over the legs, mm; likewise the next."""
    y: Array
    force: Array
    """Force error over the whole cycle, N."""
    share: Array
    """Of the feedforward."""
    steady: float
    """Steady-state error of the force in the last whole cycle; NaN of several legs."""
    tilt: Array | None
    """Largest tilt of the body, mrad; None without a body."""
    change: Array
    """(cycles - 1,): of the feedback from each cycle to the next, N m."""
    drift: dict[str, float] | None
    """As in the manifest."""

    @property
    def lasts(self) -> bool:
        """Whether it reached its end."""
        return self.status == "completed"

    @property
    def cycles(self) -> int:
        """Whole cycles that it did."""
        return len(self.x)

    @property
    def error(self) -> Array:
        """(cycles,): distance in transfer between foot and path, RMS, mm."""
        return np.hypot(self.x, self.y)

    @property
    def moving(self) -> Array:
        """:attr:`change` up to the cycle from which on it is rounding alone."""
        still = np.flatnonzero(self.change < ROUNDING * self.change.max(initial=0.0))
        return self.change[: still[0]] if len(still) else self.change

    @property
    def measured(self) -> float:
        """Growth per cycle of the change of the feedback, as :mod:`cmacexp.stability` reads it; NaN if too short."""
        first = int(self.config["learning"]["start_cycle"])
        if len(self.moving) < first + 3:
            return float("nan")
        return growth_over(self.moving, stretch(self.moving, first, self.lasts))

    @property
    def predicted(self) -> float:
        """The same as predicted from its config and its calmest cycle; NaN if it ends before."""
        first = int(self.config["learning"]["start_cycle"])
        if len(self.moving) < first + 3:
            return float("nan")
        place = stretch(self.moving, first, self.lasts)
        config = compose_config(overrides_of(self.config))
        try:
            return predicted_growth(config, place.calm).over(place.first, place.last)
        except NotPredictable:
            return float("nan")


def final(values: Array) -> float:
    """Median over the last cycles of a run; NaN of none."""
    return float(np.median(values[-NEAR:])) if len(values) else float("nan")


def best(values: Array) -> tuple[float, int]:
    """The least value and its cycle."""
    at = int(np.nanargmin(values))
    return float(values[at]), at + 1


def overrides_of(config: dict[str, Any]) -> list[str]:
    """Overrides of the runs of this study, from the config of one of them."""
    learning, force = config["learning"], config["force_control"]
    return [
        f"scenario={config['scenario']}",
        f"seed={config['seed']}",
        f"learning.rule={learning['rule']}",
        f"learning.lead={learning['lead']}",
        f"actuator.delay={config['actuator']['delay']}",
        f"gait.load_ramp={config['gait']['load_ramp']}",
        f"reference={config['reference']}",
        f"force_control.elasticity={force['elasticity']}",
        f"force_control.admittance={force['admittance']}",
    ]


def read(run: StoredRun) -> Long:
    """What one run gave."""
    config, table = run.config, run.metrics
    whole = run.whole_cycles
    table = table[table["cycle"] <= whole]
    groups = table["cycle"]

    def pooled(name: str) -> Array:
        return np.sqrt(np.asarray((table[name] ** 2).groupby(groups).mean(), dtype=float))

    last = table[table["cycle"] == whole]["force_steady_state_error"]
    return Long(
        config["learning"]["rule"],
        str(config["learning"]["lead"]),
        int(config["actuator"]["delay"]),
        int(config["seed"]),
        config,
        run.status,
        int(config["cycles"]),
        1e3 * pooled("transfer_rmse_x"),
        1e3 * pooled("transfer_rmse_y"),
        pooled("force_rmse_cycle"),
        np.asarray(table["feedforward_share"].groupby(groups).mean(), dtype=float),
        float(last.iloc[0]) if len(last) == 1 else float("nan"),
        1e3 * np.asarray(run.body_metrics["tilt_max"], dtype=float)[:whole] if run.walks else None,
        pooled("feedback_change")[1:],
        run.manifest["drift"],
    )
