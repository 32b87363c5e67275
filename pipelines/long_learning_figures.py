"""Figures and tables of the study of long learning."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.numbers import format_number
from cmacexp.study import Results, over_cycles
from cmacexp.study.interval import estimate
from pipelines import long_learning_measures as measures
from pipelines.long_learning_measures import FORCE, LEG, TRANSFER, WALK, final

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

NEAR = 0.01
"""Difference of two growths that is marked."""
SHOWN_METRICS = {
    "transfer_rmse_x": ("transfer error in x", "mm"),
    "transfer_rmse_y": ("transfer error in y", "mm"),
    "feedback_change": ("change of the feedback", "N m"),
    FORCE: ("force error", "N"),
    "tilt_max": ("largest tilt", "mrad"),
}
"""Metrics that are drawn over cycles: title and unit."""
SHOWN = (20, 100, 500)
"""Cycles in which the table of settings shows force errors."""


def _curves(results: Results, name: str, by: str, prefix: str = "") -> Panel:
    """A metric over cycles, on logarithmic axes."""
    title, unit = SHOWN_METRICS[name]
    return replace(over_cycles(results, name, by, log="xy"), title=prefix + title, y=f"{title}, {unit}")


def draw_leads(results: Results) -> "Figure":
    """The paper's rule with every lead, on both machines."""
    panels = []
    for machine, own in results.by("machine").items():
        for name in ("transfer_rmse_y", "feedback_change"):
            panels.append(_curves(own, name, "lead", f"{machine}: "))
    return draw(panels)


def draw_rules(results: Results) -> "Figure":
    """Every rule over many cycles."""
    return draw([_curves(results, f"transfer_rmse_{side}", "learning.rule") for side in "xy"])


def draw_growth(results: Results) -> "Figure":
    """Predicted against measured growth, and the difference."""
    known = measures.growth_known(results)
    groups = {machine: known[known["machine"] == machine] for machine in (LEG, WALK)}
    both = [Series(name, own["measured"], own["predicted"]) for name, own in groups.items()]
    missed = [Series(name, own["measured"], own["predicted"] - own["measured"]) for name, own in groups.items()]
    axis = "measured growth per cycle"
    panels = [
        Panel("growth of the feedback", axis, "predicted growth per cycle", both, "scatter"),
        Panel("difference", axis, "predicted - measured", missed, "scatter", y_limits=(-NEAR, NEAR)),
    ]
    return draw(panels)


def draw_settings(results: Results) -> "Figure":
    """Force error and tilt of the quadruped."""
    return draw([_curves(results, name, "settings") for name in (FORCE, "tilt_max")])


def describe_end(results: Results, name: str = TRANSFER, factor: float = 1e3) -> str:
    """How runs of several seeds end: their error at the end, or the cycle in which they ended."""
    complete = sum(results.completed)
    if complete == len(results):
        return format_number(factor * estimate(final(results, name)).value)
    ends = measures.ended_in(results)
    return f"ends in {np.median(ends[np.isfinite(ends)]):.0f}" + (f" ({complete} complete)" if complete else "")


def _describe_rate(results: Results) -> str:
    cycle = np.median(measures.learnt_in(results))
    return describe_end(results) + (f"; learnt in {cycle:.0f}" if np.isfinite(cycle) else "; never learnt")


def _describe_drift(results: Results) -> str:
    cycles = zip(("detected", "ended"), (results.measure("detected"), measures.ended_in(results)), strict=True)
    return (
        "; ".join(f"{what} in {np.median(each):.0f}" for what, each in cycles if np.isfinite(np.median(each))) or "-"
    )


def table_of_rules(results: Results, name: str = TRANSFER, factor: float = 1e3) -> "pd.DataFrame":
    """Rule by lead: error at the end, or the cycle in which runs ended."""
    return _by_lead(results, "learning.rule", "rule", lambda own: describe_end(own, name, factor))


def table_of_delays(results: Results) -> "pd.DataFrame":
    """Delay of the actuator by lead: error at the end, or the cycle in which runs ended."""
    return _by_lead(results, "actuator.delay", "delay, samples", describe_end)


def table_of_rates(results: Results) -> "pd.DataFrame":
    """Rate by lead: the same, and the first cycle with a small error."""
    return _by_lead(results, "learning.rate", "rate", _describe_rate)


def table_of_drift(results: Results) -> "pd.DataFrame":
    """Machine by lead: cycles in which drift was detected, and in which runs ended."""
    return _by_lead(results, "machine", "machine", _describe_drift)


def _by_lead(results: Results, key: str, title: str, cell: Callable[[Results], str]) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame(
        {title: str(value)} | {f"lead {lead}": cell(each) for lead, each in own.by("learning.lead").items()}
        for value, own in results.by(key).items()
    )


def table_of_growth(results: Results) -> "pd.DataFrame":
    """Predicted and measured growth under the paper's rule, mean over seeds."""
    known = measures.growth_known(results)
    names = ["predicted", "measured"]
    own = known[known["rule"] == "paper"].groupby(["machine", "lead"], as_index=False)[names].mean()
    return own.assign(**{name: [f"{value:.4f}" for value in own[name]] for name in names})


def table_of_settings(results: Results) -> "pd.DataFrame":
    """Force error of the quadruped in some cycles and at the end, and its tilt."""
    import pandas as pd

    cycles = [cycle for cycle in SHOWN if cycle <= results.value("cycles")]
    return pd.DataFrame(
        {"settings": name}
        | {f"force error in cycle {cycle}, N": estimate(own.at(cycle, FORCE)).value for cycle in cycles}
        | {"at the end, N": estimate(final(own, FORCE)).value}
        | {"tilt at the end, mrad": estimate(1e3 * final(own, "tilt_max")).value}
        for name, own in results.by("settings").items()
    )
