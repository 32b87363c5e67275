"""Four legs walk (Lin & Song 1997, section 6, Fig. 14 to 20).

``python -m pipelines.quadruped_walking`` walks with and without posture control and CMAC, draws what the paper shows,
and then what it does not: the lean under eq. 24, and that the learning law as published does not last.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Drawing, Section, Table, Text
from pipelines.analysis import figures_walk, gait_events, machine_views, walk_claims
from pipelines.analysis.gait_events import Walk
from pipelines.analysis.walk_claims import MM, PERCENT, End
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

if TYPE_CHECKING:
    import pandas as pd

ALL, PRINTED = "feedback + posture + CMAC", "the same, eq. 24 as printed"
NO_CMAC, NO_POSTURE, FEEDBACK = "feedback + posture", "feedback + CMAC", "feedback only"
PUBLISHED, LEAD = "law as published", "with a lead of one sample"
CYCLES, QUICK_CYCLES = 20, 5
LONG, QUICK_LONG = 500, 30
LADDER = (5, 10, 20)
"""Cycles that the table shows."""
SHOWN_VIEWS = {
    16: "initial posture",
    17: "lift-off of foot 3",
    18: "touch-down of foot 3",
    19: "transfer of foot 2",
    20: "touch-down of foot 2",
}
READING = (
    "Green: what the feet that carry span, with its margins along the body; dashed: the planned support polygon; "
    f"vermilion: planned transfer. Depressions of the ground are drawn {machine_views.DEPRESSION_SCALE:.0f} times "
    "too deep."
)


def jobs(quick: bool) -> Jobs:
    """The ladder of controllers, and two long runs."""
    short = ["scenario=quadruped", f"cycles={QUICK_CYCLES if quick else CYCLES}"]
    long = [
        "scenario=quadruped",
        f"cycles={QUICK_LONG if quick else LONG}",
        "record.cycles=[1]",
    ]
    return {
        FEEDBACK: [*short, "feedforward=none", "posture.gain=0"],
        NO_POSTURE: [*short, "posture.gain=0", "learning.start_cycle=1"],
        NO_CMAC: [*short, "feedforward=none"],
        ALL: short,
        PRINTED: [*short, "reference=literal"],
        PUBLISHED: long,
        LEAD: [*long, "learning.lead=1"],
    }


def end_of(run: StoredRun) -> End:
    """How a run ended."""
    return End(run.status, run.manifest["steps"] * run.config["sampling_period"], run.config["cycles"])


def _row(name: str, cycle: int, table: "pd.DataFrame", body: "pd.DataFrame") -> list[str]:
    errors = table.loc[cycle]
    return [
        name,
        str(cycle),
        "walks",
        f"{errors['force_rmse_cycle']:.2f}",
        f"{errors['force_rmse_three_feet']:.2f}",
        f"{MM * errors['transfer_rmse_x']:.1f}",
        f"{MM * errors['transfer_rmse_y']:.1f}",
        f"{PERCENT * errors['feedforward_share']:.0f}",
        f"{MM * body.set_index('cycle')['tilt_max'][cycle]:.0f}",
    ]


def ladder(runs: Runs) -> Table:
    """What each part of the controller adds."""
    rows = []
    for name in (FEEDBACK, NO_POSTURE, NO_CMAC, ALL, PRINTED):
        run, end = runs[name], end_of(runs[name])
        table = figures_walk.whole_cycles(run)
        rows += [_row(name, cycle, table, run.body_metrics) for cycle in LADDER if cycle in table.index]
        if end.status != "completed":
            rows.append([name, str(int(run.metrics["cycle"].max())), f"{end.status} at {end.time:.3f} s", *"------"])
    return Table(
        [
            "run",
            "cycle",
            "status",
            "force, N",
            "on three feet, N",
            "x, mm",
            "y, mm",
            "CMAC, %",
            "tilt, mrad",
        ],
        rows,
        "What each part adds: RMS errors over all legs (force over the whole cycle and with three feet down, "
        "position in transfer), share of CMAC in the torque, largest tilt",
    )


def _view_caption(walk: Walk, number: int, k: int, cycle: int) -> str:
    pose = machine_views.pose_of(walk, k)
    when = f"Cycle {cycle}, {walk.view.time[k] - walk.view.time[walk.view.cycle == cycle][0]:.3f} s after it began. "
    force, desired = pose.force, pose.desired
    return {
        16: f"At the start all four feet are down; they carry {force.min():.1f} to {force.max():.1f} N, as desired. ",
        17: f"{when}Foot 3 carries nothing any more. The rear margin is {MM * pose.carried[2]:.1f} mm, and foot 2 "
        f"carries {force[1]:.2f} N where {desired[1]:.2f} N are desired. ",
        18: f"{when}Foot 3 carries {force[2]:.1f} N; foot 1, of which {desired[0]:.1f} N are desired, carries "
        f"{force[0]:.1f} N; the nearest edge is {MM * pose.carried[0]:.0f} mm away. ",
        19: f"{when}Foot 2 is aloft, the front margin is {MM * pose.carried[1]:.1f} mm, and foot 3 carries "
        f"{force[2]:.2f} N. ",
        20: f"{when}Foot 2 carries {force[1]:.1f} N"
        + (", while it is still planned to be aloft" if pose.aloft[1] else "")
        + f"; the front margin is {MM * pose.carried[1]:.0f} mm. ",
    }[number]


def _drawings(walk: Walk, errors: "pd.Series") -> list[Drawing]:
    last = int(walk.view.cycle[-1])
    instants = gait_events.instants(walk, last)
    gait = gait_events.gait(walk)
    body = walk.view.config["machine"]
    drawings = [
        Drawing(
            "fig14",
            figures_walk.gait_diagram(walk),
            f"Each leg supports for {PERCENT * gait['duty_factor'].mean():.0f} % of a cycle; on the left the hind "
            f"foot touches down at {gait['touch_down'][3]:.2f} of the cycle and the front foot lifts at "
            f"{gait['lift_off'][1]:.2f}.",
            "Fig. 14: gait diagram of a wave gait",
        ),
        Drawing(
            "fig15",
            machine_views.diagram(walk),
            f"Body and two-link legs, aslant from the right; hips {MM * body['hip_height']:.0f} mm over the ground, "
            "knees outward (the paper gives neither). The pale legs are those of the left side.",
            "Fig. 15: diagram of the quadruped",
        ),
    ]
    for number, k in {16: 0, **instants}.items():
        caption = _view_caption(walk, number, k, last) + READING
        title = f"Fig. {number}: {SHOWN_VIEWS[number]}"
        drawings.append(Drawing(f"fig{number}", machine_views.views(walk, k), caption, title))
    forces = Drawing(
        "walk-forces",
        figures_walk.foot_forces(walk, last, instants),
        f"RMS force error {errors['force_rmse_three_feet']:.2f} N with three feet down and "
        f"{errors['force_rmse_cycle']:.2f} N over the whole cycle: most of it is left where four feet are down and "
        "load rocks between the diagonal pairs. Shaded: planned transfer; numbers above: instants of Fig. 17 to 20.",
        f"Foot forces over cycle {last}",
    )
    return [*drawings, forces]


def _claims(runs: Runs, walk: Walk) -> list[walk_claims.Claim]:
    view = walk.view
    config, links = view.config, runs.links
    lift, down, front = (
        f(walk) for f in (gait_events.lift_off_of_3, gait_events.touch_down_of_3, gait_events.touch_down_of_2)
    )
    printed = gait_events.touch_down_of_3(gait_events.walk_of(runs[PRINTED]))
    ends = {name: end_of(run) for name, run in runs.items()}
    tables = {name: figures_walk.pooled(runs[name].metrics) for name in (ALL, PRINTED, NO_CMAC)}
    hip_height = config["machine"]["hip_height"]
    length = float(np.ptp([leg.hip[0] for leg in view.legs]))
    off = float(np.abs(walk.force.sum(axis=1) - config["machine"]["weight"]).max())
    fallen = runs[FEEDBACK].trace.tail(4)
    fallen_least = float(fallen["force"][fallen["phase"] == "support"].min())
    least_planned = float(np.nanmin(view.body["stability_margin"]))

    def pick(names: Sequence[str]) -> dict[str, End]:
        return {name: ends[name] for name in names}

    return [
        walk_claims.gait_is_a_wave(gait_events.gait(walk), int((walk.force > 0.0).sum(axis=1).min()), links(ALL)),
        *(
            walk_claims.walks_steadily(ends[name], runs[name].body_metrics, hip_height, how, links(name))
            for name, how in ((ALL, "aware reference"), (PRINTED, "eq. 24 as printed"))
        ),
        walk_claims.posture_carries(
            pick([FEEDBACK, NO_POSTURE]), pick([NO_CMAC, ALL]), off, links(FEEDBACK, NO_POSTURE, NO_CMAC, ALL)
        ),
        walk_claims.margin_is_short(lift["rear_planned"].iloc[-1], lift["rear"].iloc[-1], length, "rear", links(ALL)),
        walk_claims.force_2_tells(lift, fallen_least, links(ALL, FEEDBACK)),
        walk_claims.foot_1_is_late(down, printed, least_planned, links(ALL, PRINTED)),
        walk_claims.margin_is_short(
            front["front_planned"].iloc[-1], front["front"].iloc[-1], length, "front", links(ALL)
        ),
        walk_claims.foot_2_restores(front, links(ALL)),
        walk_claims.feedback_diminishes(tables[ALL]["feedforward_share"], links(ALL)),
        *(
            walk_claims.control_improves(tables[n].iloc[-1], tables[NO_CMAC].iloc[-1], how, links(n, NO_CMAC))
            for n, how in ((ALL, "aware reference"), (PRINTED, "eq. 24 as printed"))
        ),
    ]


def _quadruped(runs: Runs) -> Section:
    walk = gait_events.walk_of(runs[ALL])
    tables = {name: figures_walk.pooled(runs[name].metrics) for name in (ALL, PRINTED, NO_CMAC)}
    last = tables[ALL].index[-1]
    share = {name: PERCENT * (1.0 - table["feedforward_share"].iloc[-1]) for name, table in tables.items()}
    force = {name: table["force_rmse_three_feet"].iloc[-1] for name, table in tables.items()}
    parts = [
        Text(
            "The body is quasi-static: height, pitch and roll always balance the weight, so that the "
            "centre of gravity never leaves the feet that carry; where nothing balances, the machine falls and the "
            "run ends. CMAC acts from cycle 2 on; without posture control the machine falls before, so that in that "
            "run CMAC acts from the start."
        ),
        ladder(runs),
        *_drawings(walk, tables[ALL].loc[last]),
        Drawing(
            "walk-learning",
            figures_walk.learning(tables),
            f"In cycle {last} feedback has {share[ALL]:.0f} % of the torque ({share[PRINTED]:.0f} % under eq. 24 as "
            f"printed); the RMS force error with three feet down is {force[ALL]:.2f} N, {force[PRINTED]:.2f} N under "
            f"eq. 24 as printed and {force[NO_CMAC]:.2f} N without CMAC.",
            "What learning changes",
        ),
        Text(
            "The paper also says that CMAC makes the walk more robust to sensor noise, since its input is planned. "
            "All sensors are perfect here, so that this is not tested."
        ),
    ]
    return Section("Quadruped", parts, _claims(runs, walk))


def _lean(runs: Runs) -> list[Text | Drawing]:
    config = runs[PRINTED].config
    gain, velocity = (config["controller"][name] for name in ("position_gain", "velocity_gain"))
    control, stiffness = config["force_control"], config["terrain"]["stiffness"]
    rest = 1.0 / stiffness + control["elasticity"] + velocity / gain * control["admittance"]
    bodies = {name: runs[name].body_metrics for name in (ALL, PRINTED, NO_CMAC)}
    learned = bodies[PRINTED].iloc[len(bodies[PRINTED]) // 2 :]
    high = MM * (learned["height_mean"].mean() - config["machine"]["hip_height"])
    level = MM * bodies[ALL]["tilt_max"].iloc[-1]
    return [
        Text(
            f"The lean under eq. 24. With the paper's values the term F_d/K_ap is {1.0 / gain / rest:.0f} times the "
            "rest of the reference: feet that are to carry more are sent centimetres deeper. While feedback carries "
            "the load that is right. CMAC takes the load over and leaves the references where they are; the feet "
            "follow them, each to another depth, and the body leans after its feet. The aware reference, which this "
            "study uses where it says nothing else, drops the term once a feedforward acts."
        ),
        Drawing(
            "walk-lean",
            figures_walk.lean(bodies, config["machine"]["hip_height"]),
            f"Under eq. 24 as printed the body stands {high:.0f} mm too high on average and leans by up to "
            f"{MM * learned['tilt_max'].min():.0f} to {MM * learned['tilt_max'].max():.0f} mrad in cycles "
            f"{learned['cycle'].iloc[0]} to {learned['cycle'].iloc[-1]}; with the aware reference the tilt falls to "
            f"{level:.0f} mrad.",
            "The lean of the quadruped",
        ),
    ]


def _divergence(runs: Runs) -> list[Text | Drawing]:
    tables = {name: figures_walk.whole_cycles(runs[name]) for name in (PUBLISHED, LEAD)}
    end, error = end_of(runs[PUBLISHED]), MM * tables[PUBLISHED]["transfer_rmse_x"]
    led = MM * tables[LEAD]["transfer_rmse_x"]
    ended = int(runs[PUBLISHED].metrics["cycle"].max())
    how = (
        f"it has {end.status} in cycle {ended}"
        if end.status != "completed"
        else f"it completed its {end.cycles} cycles"
    )
    best = led.iloc[len(led) // 4 :]
    return [
        Text(
            "The law as published does not last. It credits a feedback error to the cells that were read in the same "
            "step, but a torque shows in the feedback one step later. learning.lead=1 credits the cells of the step "
            "before."
        ),
        Drawing(
            "walk-divergence",
            figures_walk.divergence(tables),
            f"Law as published: the transfer error in x is least in cycle {error.idxmin()} ({error.min():.2f} mm), "
            f"then grows to {error.iloc[-1]:.1f} mm in cycle {error.index[-1]}; {how}. With a lead of one sample it "
            f"has {runs[LEAD].status} {int(led.index[-1])} cycles; from cycle {best.index[0]} on its error is "
            f"between {best.min():.2f} and {best.max():.2f} mm.",
            "The law as published does not last",
        ),
    ]


def summarise(runs: Runs) -> list[Section]:
    """The quadruped as the paper shows it, and what the paper did not see."""
    return [
        _quadruped(runs),
        Section("What the paper did not see: the quadruped", [*_lean(runs), *_divergence(runs)], beyond=True),
    ]


STUDY = Study(
    "quadruped_walking",
    "Quadruped walking",
    "Section 6 of Lin & Song 1997: four legs walk with force/position feedback, posture control and a CMAC for each "
    "leg. Posture control is what keeps the machine up; CMAC makes it level and leaves little to the feedback.",
    jobs,
    summarise,
)

if __name__ == "__main__":
    main(STUDY)
