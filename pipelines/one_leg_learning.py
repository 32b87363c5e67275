"""One leg learns to step and to press (Lin & Song 1997, sections 4 and 5, Fig. 7 to 13).

``python -m pipelines.one_leg_learning`` runs ``scenario=one_leg`` as the paper does, then with a force ramp, without
the 1/K_ap of eq. 13, on a smooth path, with an exact model instead of a CMAC, and for far more cycles.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.cli.study import main
from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.registry import SHOWN
from cmacexp.report.figures import draw
from cmacexp.study import Request, Results, Study, grid
from cmacexp.study.curves import over_cycles
from cmacexp.study.interval import estimate
from pipelines import one_leg_learning_figures as figures
from pipelines import one_leg_learning_measures as measured
from pipelines.one_leg_learning_claims import (
    AWARE,
    CLAIMS,
    CMAC,
    CYCLES,
    ERRORS,
    FIFTH,
    FINDINGS,
    FIRST,
    LEAD,
    NO_LEAD,
    PAPER,
    PUBLISHED,
    RAMPED,
    SECOND,
    SMOOTH,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SHORT, QUICK_SHORT, LONG, QUICK_LONG = 20, 6, 250, 12
LATE = 100
"""Cycle of the long runs that is compared with the fifth."""
RAMP = 0.2
"""Time over which the foot takes its desired force, s."""
VARIANTS = {
    PUBLISHED: (),
    RAMPED: (f"gait.load_ramp={RAMP}",),
    AWARE: ("reference=aware",),
    SMOOTH: ("gait.vertical=two_cubics", "reference=aware"),
}
FEEDFORWARDS = {"cmac": "CMAC", "inverse_dynamics": "exact inverse dynamics"}
LAWS = {NO_LEAD: ("learning.lead=0",), LEAD: ("learning.lead=1",)}


def runs(quick: bool) -> list[Request]:
    """The paper's run and what differs from it, an exact model on two paths, and long runs with and without lead."""
    shown = f"record.cycles=[{','.join(map(str, CYCLES))}]"
    short = ("scenario=one_leg", f"cycles={QUICK_SHORT if quick else SHORT}", shown)
    late = f"record.cycles=[{FIFTH},{QUICK_LONG if quick else LATE}]"
    long = ("scenario=one_leg", f"cycles={QUICK_LONG if quick else LONG}", late)
    exact = {name: VARIANTS[name] for name in (PUBLISHED, SMOOTH)}
    return [
        *grid(*short, over={"variant": VARIANTS}, seeded=True),
        *grid(*short, "feedforward=inverse_dynamics", over={"variant": exact}),
        *grid(*long, over={"law": LAWS}, seeded=True),
    ]


MEASURES = {
    "peak_x": measured.in_cycle(FIRST, measured.peak_error("x", "stroke")),
    "peak_y": measured.in_cycle(FIRST, measured.peak_error("y", "lift")),
    "force_peak": measured.in_cycle(FIRST, measured.force_peak),
    "weight": measured.in_cycle(FIRST, measured.weight_at_foot),
    "oscillation_second": measured.in_cycle(SECOND, measured.force_oscillation),
    "oscillation_fifth": measured.in_cycle(FIFTH, measured.force_oscillation),
    "torque_oscillation": measured.in_cycle(FIFTH, measured.torque_oscillation),
    "torque_step": measured.in_cycle(FIFTH, measured.torque_step),
    "lift_off_early": measured.in_cycle(FIFTH, measured.feedback_at_lift_off),
    "lift_off_late": measured.in_last_recorded(measured.feedback_at_lift_off),
}


def draw_bias(results: Results) -> "Figure":
    """Force error from the second cycle on with and without the 1/K_ap of eq. 13, and what statics predict."""
    own = results.select(CMAC, variant=[PUBLISHED, AWARE])
    panel = over_cycles(own, "force_steady_state_error", "variant")
    predicted = 100.0 * measured.learned_error(own.run.config)
    later = [replace(s, x=np.asarray(s.x)[1:], y=np.asarray(s.y)[1:], low=None, high=None) for s in panel.series]
    title = "steady-state error of the force"
    return draw([replace(panel, title=title, y="relative error, %", series=later, y_limits=[0.0, predicted])])


def draw_growth(results: Results) -> "Figure":
    """Feedback torque and error in transfer over a long run, by learning law."""
    own = results.select(law=list(LAWS))
    return draw([over_cycles(own, name, "law", log="y") for name in ("feedback_rms", "transfer_rmse_x")])


def draw_exact(results: Results) -> "Figure":
    """Error in transfer in y with a CMAC and with exact inverse dynamics, on both paths."""
    panels = [
        over_cycles(results.select(variant=v), "transfer_rmse_y", "feedforward", log="y") for v in (PUBLISHED, SMOOTH)
    ]
    return draw(
        [
            replace(panel, title=title, series=[replace(s, name=FEEDFORWARDS[s.name]) for s in panel.series])
            for panel, title in zip(panels, ("path as published", "smooth path"), strict=True)
        ]
    )


def errors_table(results: Results) -> "pd.DataFrame":
    """Errors and torques in the paper's cycles, with a step and with a ramp of the force."""
    import pandas as pd

    rows = []
    for name, variant in (("step", PUBLISHED), ("ramp", RAMPED)):
        own = results.select(CMAC, variant=variant)
        for cycle in CYCLES:
            cells = {
                f"{SHOWN[metric].title}, {SHOWN[metric].unit}": SHOWN[metric].factor
                * estimate(own.at(cycle, metric)).value
                for metric in (*ERRORS, "feedback_rms", "feedforward_share")
            }
            rows.append({"force": name, "cycle": cycle, **cells})
    return pd.DataFrame(rows)


def values(results: Results) -> dict[str, Any]:
    """What the page says of settings, path and statics."""
    run, published = results.select(PAPER).run, results.select(law=NO_LEAD)
    config, rows = run.config, run.cycle(FIRST)
    weight = float(results.select(PAPER).measure("weight")[0])
    jumps = {axis: max(map(abs, measured.velocity_jumps(rows, axis))) for axis in ("x", "y")}
    return {
        "first": FIRST, "second": SECOND, "fifth": FIFTH, "late": int(published.run.trace["cycle"].max()),
        "long": published.value("cycles"), "ended": ", ".join(map(str, published.cycles)), "ramp": RAMP,
        "band": 100.0 * figures.BAND,
        "touch_down": figures.number_points(rows, FIFTH)[measured.touch_down(rows)],
        "depth": 1e3 * measured.reference_depth(config), "reach": 1e3 * figures.get_reach(run),
        "nearest": 1e3 * measured.reference_distance(rows), "jump_x": jumps["x"], "jump_y": jumps["y"],
        "weight": weight, "statics": measured.feedback_force(config, weight),
        "weightless": measured.feedback_force(config, 0.0), "bias": 100.0 * measured.learned_error(config),
        "swing_start": measured.SWING_START,
        "lift_off_early": 100.0 * estimate(published.measure("lift_off_early")).value,
        "lift_off_late": 100.0 * estimate(published.measure("lift_off_late")).value,
    }  # fmt: skip


def _of_first_seed(drawing: "Callable[[StoredRun], Figure]") -> "Callable[[Results], Figure]":
    return lambda results: drawing(results.select(PAPER).run)


STUDY = Study(
    title="One leg learns to step and to press",
    question="What does a CMAC learn on one leg that steps and presses, and what errors remain?",
    runs=runs,
    measures=MEASURES,
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "one_leg": _of_first_seed(figures.glance),
        "fig_07": _of_first_seed(figures.trajectory),
        "fig_08": _of_first_seed(figures.velocities),
        "fig_09": _of_first_seed(figures.accelerations),
        "fig_10": _of_first_seed(lambda run: figures.tracking(run, FIRST)),
        "fig_11": _of_first_seed(lambda run: figures.tracking(run, FIFTH)),
        "fig_12": _of_first_seed(figures.forces),
        "fig_13": _of_first_seed(figures.torques),
        "bias": draw_bias,
        "growth": draw_growth,
        "exact": draw_exact,
    },
    tables={"errors": errors_table},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
