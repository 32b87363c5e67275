"""Four legs walk (Lin & Song 1997, section 6, Fig. 14 to 20).

``python -m pipelines.quadruped_walking`` walks with and without posture control and CMAC, with noisy sensors, and
longer than the paper, and draws the paper's figures from these runs.
"""

from typing import TYPE_CHECKING, Any

from cmacexp.cli.study import main
from cmacexp.report.figures import draw
from cmacexp.study import Request, Results, Study, grid
from cmacexp.study.curves import over_cycles
from pipelines import quadruped_walking_figures as figures
from pipelines.quadruped_walking_events import LATE, instants
from pipelines.quadruped_walking_measures import (
    ALL,
    FEEDBACK,
    LADDER,
    LEAD,
    LONG,
    NO_CMAC,
    NO_POSTURE,
    NOISE,
    PRINTED,
    PUBLISHED,
    UNSEEDED,
    deviations,
    events,
    in_part,
    shown_walk,
)
from pipelines.quadruped_walking_statements import CLAIMS, FINDINGS
from pipelines.quadruped_walking_views import DEPRESSION_SCALE, diagram, views

if TYPE_CHECKING:
    import pandas as pd

CYCLES, LONG_CYCLES, QUICK_CYCLES, QUICK_LONG_CYCLES = 20, 500, 5, 8
SHOWN_CYCLES = (1, 5, 10, 20)
"""Cycles that the table of errors shows."""
COLUMNS = {
    "force, N": ("force_rmse_cycle", 1.0),
    "three feet, N": ("force_rmse_three_feet", 1.0),
    "x, mm": ("transfer_rmse_x", 1e3),
    "y, mm": ("transfer_rmse_y", 1e3),
    "CMAC, %": ("feedforward_share", 1e2),
    "tilt, mrad": ("tilt_max", 1e3),
}
"""Of that table: metric, and factor to the unit shown."""
CONTROLLERS = {
    FEEDBACK: ["feedforward=none", "posture.gain=0"],
    NO_POSTURE: ["posture.gain=0", "learning.start_cycle=1"],
    NO_CMAC: ["feedforward=none"],
    ALL: [],
    PRINTED: ["reference=literal"],
}
LAWS = {PUBLISHED: ["learning.lead=0"], LEAD: ["learning.lead=1"]}
NOISES = {
    "force.noise_relative": 0.2,
    "position.noise": 1e-4,
    "velocity.noise": 0.02,
    "height.noise": 1e-4,
    "tilt.noise": 1e-4,
}
"""White noise of sensors, in the fields' units."""


def runs(quick: bool) -> list[Request]:
    """The ladder of controllers; noisy sensors with and without CMAC; and two learning laws for long."""
    short, long = (QUICK_CYCLES, QUICK_LONG_CYCLES) if quick else (CYCLES, LONG_CYCLES)
    walk = ("scenario=quadruped", f"cycles={short}")
    found = []
    for name, overrides in CONTROLLERS.items():
        found += grid(*walk, *overrides, seeded=name not in UNSEEDED, part=LADDER, controller=name)
    last = ",".join(str(cycle) for cycle in range(max(1, short - LATE + 1), short + 1))
    for name in (NO_CMAC, ALL):
        noisy = ["sensors=real", *(f"sensors.{key}={level}" for key, level in NOISES.items())]
        found += grid(*walk, *CONTROLLERS[name], *noisy, f"record.cycles=[{last}]", seeded=True, part=NOISE,
                      controller=name)  # fmt: skip
    run = ("scenario=quadruped", f"cycles={long}", "record.cycles=[1]")
    return found + grid(*run, over={"law": LAWS}, seeded=True, part=LONG, controller=ALL)


def ladder_table(results: Results) -> "pd.DataFrame":
    """Every controller in the cycles that all its runs reach, mean over seeds."""
    import pandas as pd

    rows = []
    for name, own in in_part(results, LADDER).by("controller").items():
        walks = {"controller": name, "walk to the end": f"{sum(own.completed)} of {len(own)}"}
        shown = [cycle for cycle in SHOWN_CYCLES if cycle <= min(own.cycles)]
        rows += [
            walks | {"cycle": cycle} | {title: scale * own.at(cycle, metric).mean()
                                        for title, (metric, scale) in COLUMNS.items()}
            for cycle in shown
        ] or [walks]  # fmt: skip
    return pd.DataFrame(rows).astype({"cycle": "Int64"})


def noise_table(results: Results) -> "pd.DataFrame":
    """What noise changes, mean over seeds."""
    table = results.computed["noise"].groupby("controller", sort=False, as_index=False)
    return table[["feet", "force"]].mean().rename(columns={"feet": "feet, mm", "force": "force, N"})


LINEAR = ("feedforward_share", "tilt_max", "height_mean")


def _curves(part: str, by: str, *metrics: str, **chosen: Any) -> Any:
    def work(results: Results) -> Any:
        own = in_part(results, part).select(chosen)
        return draw([over_cycles(own, name, by, "" if name in LINEAR else "y") for name in metrics], columns=3)

    return work


LEARNT = {"controller": [ALL, PRINTED, NO_CMAC]}


def values(results: Results) -> dict[str, Any]:
    """Settings of the runs, and when Fig. 17 to 20 are."""
    ladder = in_part(results, LADDER)
    printed, walk, cycle = ladder.select(controller=PRINTED), *shown_walk(results)
    p, v, stiffness, elasticity, admittance = (
        printed.value(key)
        for key in ("controller.position_gain", "controller.velocity_gain", "terrain.stiffness",
                    "force_control.elasticity", "force_control.admittance")
    )  # fmt: skip
    began = walk.view.time[walk.view.cycle == cycle][0]
    times = {f"fig{n}": float(walk.view.time[k] - began) for n, k in instants(walk, cycle).items()}
    return times | {
        "last": cycle, "late": LATE, "depth": DEPRESSION_SCALE, "cycles": ladder.value("cycles"),
        "long": in_part(results, LONG).value("cycles"), "cmac_from": printed.value("learning.start_cycle"),
        "term": (1.0 / p) / (1.0 / stiffness + elasticity + v / p * admittance),
        "noise": {key.replace(".", "_"): level for key, level in NOISES.items()},
        "hip_height": 1e3 * printed.value("machine.hip_height"),
    }  # fmt: skip


def _view(number: int) -> Any:
    def work(results: Results) -> Any:
        walk, cycle = shown_walk(results)
        return views(walk, ({16: 0} | instants(walk, cycle))[number])

    return work


STUDY = Study(
    title="Quadruped walking",
    question="How do posture control and a CMAC for each leg change the walk of four legs on soft ground, with "
    "perfect and with noisy sensors, and for how long?",
    runs=runs,
    computed={"events": events, "noise": deviations},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "fig14": lambda r: figures.gait_diagram(shown_walk(r)[0]),
        "fig15": lambda r: diagram(shown_walk(r)[0]),
        **{f"fig{number}": _view(number) for number in range(16, 21)},
        "forces": lambda r: figures.foot_forces(*shown_walk(r)),
        "learning": _curves(LADDER, "controller", "feedforward_share", "transfer_rmse_y", "force_rmse_three_feet",
                            **LEARNT),
        "lean": _curves(LADDER, "controller", "tilt_max", "height_mean", **LEARNT),
        "long": _curves(LONG, "law", "transfer_rmse_x", "transfer_rmse_y", "feedback_rms"),
    },
    tables={"ladder": ladder_table, "noise": noise_table},
    values=values,
)  # fmt: skip

if __name__ == "__main__":
    main(__file__)
