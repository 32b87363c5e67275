"""Four legs walk (Lin & Song 1997, section 6, Fig. 14 to 20).

``python -m pipelines.quadruped_walking`` walks with and without posture control and CMAC, with noisy sensors, and
longer than the paper, and draws the paper's figures from these runs.
"""

from typing import TYPE_CHECKING, Any

from cmacexp.cli.study import main
from cmacexp.report.figures import Panel, draw
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, grid
from cmacexp.study.curves import over_cycles
from pipelines import quadruped_walking_figures as figures
from pipelines.quadruped_walking_claims import CLAIMS
from pipelines.quadruped_walking_events import LATE, instants
from pipelines.quadruped_walking_measures import (
    ALL,
    FEEDBACK,
    LADDER,
    LONG,
    NO_CMAC,
    NO_POSTURE,
    NOISE,
    PRINTED,
    UNSEEDED,
    at_end,
    bursts,
    deviations,
    events,
    in_part,
    shown_walk,
    walked,
)
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
PUBLISHED, LEAD = "as published", "lead of one sample"
LAWS = {PUBLISHED: ["learning.lead=0"], LEAD: ["learning.lead=1"]}
LEVELS = {
    "force": {"force.noise_relative": 0.2},
    "joints": {"position.noise": 1e-4, "velocity.noise": 0.02},
    "height and tilt": {"height.noise": 1e-4, "tilt.noise": 1e-4},
}
"""White noise of sensors, in the fields' units."""
LEVELS["all"] = {key: level for levels in LEVELS.values() for key, level in levels.items()}
NOISES = {
    name: ["sensors=real", *(f"sensors.{key}={level}" for key, level in levels.items())]
    for name, levels in LEVELS.items()
}
LITTLE_MORE = 1.25
"""Errors with noise over those without, up to which noise costs little accuracy."""
LASTS = 0.9
"""Part of the cycles from which on a law lasts."""
BURST = 2.0
"""Ratio of errors from which on they have grown again."""


def runs(quick: bool) -> list[Request]:
    """The ladder of controllers; noisy sensors with and without CMAC; and two learning laws for long."""
    short, long = (QUICK_CYCLES, QUICK_LONG_CYCLES) if quick else (CYCLES, LONG_CYCLES)
    walk = ("scenario=quadruped", f"cycles={short}")
    found = []
    for name, overrides in CONTROLLERS.items():
        found += grid(*walk, *overrides, seeded=name not in UNSEEDED, part=LADDER, controller=name)
    last = ",".join(str(cycle) for cycle in range(max(1, short - LATE + 1), short + 1))
    for name in (NO_CMAC, ALL):
        noisy = (*walk, *CONTROLLERS[name], f"record.cycles=[{last}]")
        found += grid(*noisy, over={"noise": NOISES}, seeded=True, part=NOISE, controller=name)
    run = ("scenario=quadruped", f"cycles={long}", "record.cycles=[1]")
    return found + grid(*run, over={"law": LAWS}, seeded=True, part=LONG, controller=ALL)


FINDINGS = {
    "lean": Finding(
        [
            Criterion(
                f"largest tilt in a cycle, median of the last {LATE}, {name}",
                lambda r: r.end("tilt_max", LATE),
                limit,
                unit="mrad",
                scale=1e3,
                of={"part": LADDER, "controller": controller},
            )
            for controller, name, limit in (
                (PRINTED, "eq. 24 as printed", at_least(0.05)),
                (ALL, "aware reference", at_most(0.02)),
            )
        ],
        yes="Once the CMAC has learnt, the body leans by {value} under eq. 24 as printed, and by {values[1]} with "
        "the aware reference: use `reference=aware` under a body.",
        no="Once the CMAC has learnt, the body leans by {value} under eq. 24 as printed and by {values[1]} with the "
        "aware reference: this does not single out the aware reference.",
        unclear="These runs do not decide whether the aware reference keeps the body level where eq. 24 as printed "
        "does not.",
    ),
    "rocking": Finding(
        [
            Criterion(f"part of the squared force error {what}, last {LATE} cycles", at_end(column), at_least(0.5),
                      unit="%", scale=100.0, of={"part": LADDER, "controller": ALL})
            for what, column in (
                ("where four feet are planned to be down", "four_feet"),
                ("there that moves load between the diagonal pairs of feet", "diagonal"),
            )
        ],
        yes="Most of the force error that is left ({value} of its square) falls where four feet are planned to be "
        "down, and {values[1]} of that moves load from one diagonal pair of feet to the other.",
        no="The force error that is left is not mainly load that moves between the diagonal pairs of four feet.",
        unclear="It is open whether the force error that is left is mainly load that moves between the diagonal "
        "pairs of four feet.",
    ),
    "noise_cost": Finding(
        [
            Criterion(f"transfer error in {side} at the end, all sensors noisy over perfect ones", sample,
                      at_most(LITTLE_MORE), of={"controller": ALL})
            for side, sample in (
                (side, lambda r, m=f"transfer_rmse_{side}": (
                    in_part(r, NOISE).select(noise="all").end(m, LATE) / in_part(r, LADDER).end(m, LATE)
                )) for side in "xy"
            )
        ],
        yes="With CMAC all noises together cost little accuracy: errors are {value} and {values[1]} times those with "
        "perfect sensors in x and y.",
        no="With CMAC all noises together cost accuracy: errors are {value} and {values[1]} times those with perfect "
        "sensors in x and y.",
        unclear="The seeds differ too much to say whether all noises together cost accuracy with CMAC.",
    ),
    "lasting": Finding(
        [
            Criterion(f"part of the cycles that are walked, {law}", walked, limit, unit="%", scale=100.0,
                      of={"part": LONG, "law": law})
            for law, limit in ((PUBLISHED, at_most(LASTS)), (LEAD, at_least(LASTS)))
        ],
        yes="The law as published does not last: it ends after {value} of the cycles, and with a lead of one sample "
        "the machine walks {values[1]} of them. Set `learning.lead=1`.",
        no="A lead of one sample does not decide whether learning lasts: the law as published walks {value} of the "
        "cycles, with the lead the machine walks {values[1]}.",
        unclear="The seeds differ too much to say whether a lead of one sample decides how long learning lasts.",
    ),
    "bursts": Finding(
        [Criterion("largest transfer error in x in the last fifth of the cycles over the median of the second fifth",
                   bursts, at_least(BURST), of={"part": LONG, "law": LEAD})],
        yes="Even with the lead errors do not stay small: in the last fifth of the cycles the transfer error in x "
        "rises to {value} times its median in the second fifth.",
        no="With the lead errors stay small: in the last fifth of the cycles the transfer error in x is at most "
        "{value} times its median in the second fifth.",
        unclear="The seeds differ too much to say whether errors stay small with the lead.",
    ),
}  # fmt: skip


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
    """What each noise changes, mean over seeds."""
    table = results.computed["noise"].groupby(["noise", "controller"], sort=False, as_index=False)
    return table[["feet", "force"]].mean().rename(columns={"feet": "feet, mm", "force": "force, N"})


def _curves(part: str, by: str, *metrics: str, **chosen: Any) -> Any:
    def work(results: Results) -> Any:
        own = in_part(results, part).select(chosen)
        panels: list[Panel] = [
            over_cycles(own, name, by, "" if name in ("feedforward_share", "tilt_max", "height_mean") else "y")
            for name in metrics
        ]
        return draw(panels, columns=3)

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
        "noise": {key.replace(".", "_"): level for key, level in LEVELS["all"].items()},
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
