"""Four legs walk (Lin & Song 1997, section 6, Fig. 14 to 20).

``python -m pipelines.quadruped_walking`` walks with and without posture control and CMAC, with noisy sensors, and
longer than the paper, and draws the paper's figures from these runs.
"""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.commands.study import main
from cmacexp.study import Claim, Criterion, Finding, Request, Results, Study, at_least, at_most, between, grid
from cmacexp.study.samples import Sample, ratio
from cmacexp.study.statements import Limit
from cmacexp.study.tables import completed, ends, tabulate
from cmacexp.typing import Array
from pipelines import quadruped_walking_events as measured
from pipelines import quadruped_walking_figures as figures
from pipelines.common_results import draw_cycles, percent, share_done
from pipelines.quadruped_walking_events import LATE, Walk, event, instants, late

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LADDER, NOISE, LONG = "ladder", "noise", "long"
"""Parts of the study."""
FEEDBACK, NO_POSTURE, NO_CMAC = "feedback", "feedback + CMAC", "feedback + posture"
ALL, PRINTED = "all, aware reference", "all, eq. 24 as printed"
CONTROLLERS = {
    FEEDBACK: ["feedforward=none", "posture.gain=0"],
    NO_POSTURE: ["posture.gain=0", "learning.start_cycle=1"],
    NO_CMAC: ["feedforward=none"],
    ALL: [],
    PRINTED: ["reference=literal"],
}
UNSEEDED = (FEEDBACK, NO_CMAC)
"""Controllers that learn nothing, so that with perfect sensors no seed matters."""
PUBLISHED, LEAD = "as published", "lead of one sample"
LAWS = {PUBLISHED: ["learning.lead=0"], LEAD: ["learning.lead=1"]}
NOISES = {
    "force.noise_relative": 0.2,
    "position.noise": 1e-4,
    "velocity.noise": 0.02,
    "height.noise": 1e-4,
    "tilt.noise": 1e-4,
}
"""White noise of sensors, in the fields' units."""
WALKS, FALLS = at_least(0.9), at_most(0.5)
"""Parts of the cycles that are walked."""
STEADY, LEANS = at_most(0.02), at_least(0.05)
"""Tilt, rad."""
SHORT, OUTSIDE = between(0.0, 0.1), at_most(0.0)
"""A margin as a part of the length of the body."""
IMPROVED, NOT_IMPROVED = at_most(0.8), at_least(1.0)
"""What is to be less, over what it is to be less than: of errors, of the feedback and of what noise changes."""
NEAR, FAR = at_most(0.05), at_least(0.1)
"""Departures from the gait as parts of a cycle: a quarter and half of a transfer."""
LATE_CYCLES = f"median of the last {LATE} cycles"
ERRORS = {
    "transfer_rmse_x": "transfer, in x",
    "transfer_rmse_y": "transfer, in y",
    "force_rmse_three_feet": "force, three feet down",
    "force_rmse_cycle": "force, whole cycle",
}


def runs(quick: bool) -> list[Request]:
    """The ladder of controllers; noisy sensors with and without CMAC; and two learning laws for long."""
    short, long = (5, 8) if quick else (20, 500)
    walk = ("scenario=quadruped", f"cycles={short}")
    found = []
    for name, overrides in CONTROLLERS.items():
        found += grid(*walk, *overrides, seeded=name not in UNSEEDED, part=LADDER, controller=name)
    last = ",".join(str(cycle) for cycle in range(max(1, short - LATE + 1), short + 1))
    noisy = ["sensors=real", *(f"sensors.{key}={level}" for key, level in NOISES.items())]
    for name in (NO_CMAC, ALL):
        own = (*walk, *CONTROLLERS[name], *noisy, f"record.cycles=[{last}]")
        found += grid(*own, seeded=True, part=NOISE, controller=name)
    run = ("scenario=quadruped", f"cycles={long}", "record.cycles=[1]")
    return found + grid(*run, over={"law": LAWS}, seeded=True, part=LONG, controller=ALL)


def events(results: Results) -> "pd.DataFrame":
    """The events of the full controllers: one row per run and whole cycle."""
    import pandas as pd

    own = results.select(part=LADDER, controller=[ALL, PRINTED])
    labels = [{name: row.settings[name] for name in ("controller", "seed")} for row in own.rows]
    found = [
        measured.events_in(run).assign(run=str(run.folder), **by) for run, by in zip(own.runs, labels, strict=True)
    ]
    return pd.concat(found, ignore_index=True)


def deviations(results: Results) -> "pd.DataFrame":
    """What noise changes in the last cycles, by controller and seed: ``feet``, mm, and ``force``, N.

    RMS over all samples and legs of the difference from the run with perfect sensors, the same controller and seed;
    infinite if either run did not complete.
    """
    import pandas as pd

    noisy, rows = results.select(part=NOISE), []
    for row, run in zip(noisy.rows, noisy.runs, strict=True):
        by = {name: row.settings[name] for name in ("controller", "seed")}
        same = {**by, "seed": 0} if by["controller"] in UNSEEDED else by
        reference = results.select(same, part=LADDER).run
        feet = force = np.inf
        if run.status == reference.status == "completed":
            cycles, columns = range(max(1, run.whole_cycles - LATE + 1), run.whole_cycles + 1), ["x", "y", "force"]
            change = ((run.cycles(cycles)[columns] - reference.cycles(cycles)[columns]) ** 2).mean()
            feet, force = 1e3 * float(change["x"] + change["y"]) ** 0.5, float(change["force"]) ** 0.5
        rows.append({**by, "feet": feet, "force": force})
    return pd.DataFrame(rows)


def _noise_ratio(column: str) -> Sample:
    """What noise changes with CMAC, over what they change without; one value for each seed."""

    def sample(results: Results) -> Array:
        by_seed = results.computed["noise"].pivot_table(index="seed", columns="controller", values=column)
        return (by_seed[ALL] / by_seed[NO_CMAC]).to_numpy()

    return sample


def _end(metric: str) -> Sample:
    return partial(Results.end, name=metric, cycles=LATE)


of_ladder = partial(percent, of={"part": LADDER})


def _tilt(case: str, holds: Limit, fails: Limit | None = None, **of: Any) -> Criterion:
    quantity = f"largest tilt in a cycle, {LATE_CYCLES}"
    return Criterion(quantity, _end("tilt_max"), holds, fails, "mrad", 1e3, {"part": LADDER} | of, case)


def _claims(controller: str, how: str) -> dict[str, Claim]:
    """The claims about the full controller, with one of its references."""
    of = {"part": LADDER, "controller": controller}
    of_walk = partial(of_ladder, controller=controller)
    return {
        f"walks_{how}": Claim(
            f"Force/position feedback, posture control, and CMAC provide stable and steady walking ({how})",
            "section 6.3",
            [
                of_walk("part of the cycles that are walked", share_done, WALKS, FALLS),
                _tilt("", STEADY, LEANS, controller=controller),
                of_walk(f"largest difference from the planned height in the last {LATE} cycles", measured.height_off,
                        at_most(0.01), at_least(0.05)),
            ],
        ),
        f"rear_{how}": Claim(
            f"When foot 3 is lifted the COG remains in the support pattern, the rear margin is very short ({how})",
            "section 6.3, Fig. 17",
            [of_walk(f"rear margin over the length of the body, {LATE_CYCLES}", late("rear", -np.inf), SHORT,
                     OUTSIDE)],
        ),
        f"late_{how}": Claim(
            "Immediately after foot 3 touches down F_n1 is not 0 although F_d1 = 0, due to the delay of leg 1; the "
            f"delay has no adverse effect on stability ({how})",
            "section 6.3, Fig. 18",
            [
                of_walk("part of the cycles in which foot 1 carries then",
                        event("force_1", lambda force: float((force > 0.0).mean())), at_least(0.5), at_most(0.05)),
                Criterion("least margin until foot 1 lifts, over the least planned margin",
                          measured.margin_while_late, at_least(1.0), at_most(0.0), of=of),
            ],
        ),
        f"front_{how}": Claim(
            f"While foot 2 is still in transfer the COG is close to the front support boundary ({how})",
            "section 6.3, Fig. 19",
            [of_walk(f"front margin over the length of the body, {LATE_CYCLES}", late("front", -np.inf), SHORT,
                     OUTSIDE)],
        ),
        f"restored_{how}": Claim(
            f"Stability is immediately restored by leg 2, which is gaining a firm support ({how})",
            "section 6.3, Fig. 20",
            [
                Criterion(f"time from the contact of foot 2 until the margin is restored, {LATE_CYCLES}",
                          late("restored", np.inf), at_most(0.1), at_least(0.3), "s", of=of),  # transfer: 0.6 s
                Criterion(f"least front margin after the contact over that before it, {LATE_CYCLES}",
                          late("front_gain", -np.inf), at_least(1.0), at_most(0.0), of=of),
            ],
        ),
        f"feedback_{how}": Claim(
            f"The contribution from the feedback control diminishes ({how})",
            "section 6.3",
            [Criterion("share of feedback in the torque at the end over that in the first cycle with CMAC",
                       measured.feedback_left, IMPROVED, NOT_IMPROVED, of=of)],
        ),
        f"improves_{how}": Claim(
            f"Learning improves the accuracy of position and force control, also of the quadruped ({how})",
            "abstract, section 7",
            [Criterion("error at the end over that without CMAC",
                       ratio(_end(metric), {"controller": controller}, {"controller": NO_CMAC}), IMPROVED,
                       NOT_IMPROVED, of={"part": LADDER, "controller": [controller, NO_CMAC]}, case=name)
             for metric, name in ERRORS.items()],
        ),
    }  # fmt: skip


CLAIMS = {
    "wave": Claim(
        "Wave gait with a duty factor of 0.8: foot lifting propagates from the hind to the front legs, the sides are "
        "half a cycle out of phase, at least three feet are on the ground",
        "sections 6, 6.1, Fig. 14",
        [
            of_ladder(f"largest difference of a leg's contact from the duty factor, {LATE_CYCLES}",
                      late("duty_factor_off", np.inf), NEAR, FAR, controller=ALL),
            of_ladder(f"largest difference of a leg's lifting from the wave, of a cycle, {LATE_CYCLES}",
                      late("wave_off", np.inf), NEAR, FAR, controller=ALL),
            of_ladder("part of the time in which fewer than three feet carry", event("two_feet", np.mean),
                      at_most(0.0), at_least(0.01), controller=ALL),
        ],
    ),
    "posture": Claim(
        "The foot contact forces depend on the posture of the machine, and posture control obtains the desired one",
        "sections 6, 6.2",
        [
            of_ladder("part of the cycles that are walked", share_done, *limits, case=name, controller=name)
            for name, limits in (
                (FEEDBACK, (FALLS, WALKS)), (NO_POSTURE, (FALLS, WALKS)),
                (NO_CMAC, (WALKS, FALLS)), (ALL, (WALKS, FALLS)),
            )
        ],
    ),
    "indicator": Claim(
        "The foot force F_n2 is another indicator for stability; when it is 0 the system is likely to fail",
        "section 6.3, Fig. 17",
        [
            Criterion(f"correlation of F_n2 with the rear margin while foot 3 is aloft, {LATE_CYCLES}",
                      late("correlation"), at_least(0.9), at_most(0.0), of={"part": LADDER, "controller": ALL}),
            of_ladder("least force of a supporting foot as the machine falls, over the weight",
                      measured.least_force_at_fall, at_most(0.02), at_least(0.1), controller=[FEEDBACK, NO_POSTURE]),
        ],
    ),
    **_claims(PRINTED, "eq. 24 as printed"),
    **_claims(ALL, "aware reference"),
    "noise": Claim(
        "Improved robustness toward the sensor noises because the input of CMAC comes directly from trajectory "
        "planning, not from measurement",
        "section 6.3",
        [
            Criterion(f"change by noise with CMAC over that without, last {LATE} cycles",
                      _noise_ratio(column), IMPROVED, NOT_IMPROVED, of={"controller": [ALL, NO_CMAC]}, case=what)
            for what, column in (("the feet's positions", "feet"), ("the contact forces", "force"))
        ],
    ),
}  # fmt: skip

FINDINGS = {
    "lean": Finding(
        [
            _tilt("eq. 24 as printed", LEANS, controller=PRINTED),
            _tilt("aware reference", STEADY, controller=ALL),
        ],
        yes="Once the CMAC has learnt, the body leans by {value} under eq. 24 as printed, and by {values[1]} with "
        "the aware reference: use `reference=aware` under a body.",
        no="Once the CMAC has learnt, the body leans by {value} under eq. 24 as printed and by {values[1]} with the "
        "aware reference: the reference does not decide.",
    ),
    "rocking": Finding(
        [
            of_ladder(f"part of the squared force error {what}, last {LATE} cycles", late(column), at_least(0.5),
                      controller=ALL)
            for what, column in (
                ("where four feet are planned to be down", "four_feet"),
                ("there that moves load between the diagonal pairs of feet", "diagonal"),
            )
        ],
        yes="Most of the force error that is left ({value} of its square) falls where four feet are planned to be "
        "down, and {values[1]} of that moves load from one diagonal pair of feet to the other.",
        no="Most of the force error that is left is something else than load that moves between the diagonal pairs "
        "of feet.",
    ),
    "noise_cost": Finding(
        [
            Criterion("transfer error at the end, all sensors noisy over perfect ones",
                      ratio(_end(f"transfer_rmse_{side}"), {"part": NOISE}, {"part": LADDER}), at_most(1.25),
                      of={"controller": ALL}, case=f"in {side}")
            for side in "xy"
        ],
        yes="With CMAC, noise on all sensors costs little accuracy: transfer errors are {value} times as large in x "
        "and {values[1]} in y.",
        no="With CMAC, noise on all sensors costs accuracy: transfer errors are {value} times as large in x and "
        "{values[1]} in y.",
    ),
    "lasting": Finding(
        [
            percent("part of the cycles that are walked", share_done, limit, case=law, part=LONG, law=law)
            for law, limit in ((PUBLISHED, at_most(0.9)), (LEAD, at_least(0.9)))
        ],
        yes="With the law as published the walk ends after {value} of the cycles; with a lead of one sample the "
        "machine completes {values[1]} of them. Set `learning.lead=1`.",
        no="A lead of one sample does not decide whether learning lasts: with the law as published the machine "
        "completes {value} of the cycles, with the lead {values[1]}.",
    ),
    "bursts": Finding(
        [Criterion("largest transfer error in x in the last fifth of the cycles over the median of the second fifth",
                   measured.bursts, at_least(2.0), of={"part": LONG, "law": LEAD})],
        yes="Even with the lead, errors grow again: the transfer error in x rises to {value} times its earlier "
        "median.",
        no="With the lead, errors stay small.",
    ),
}  # fmt: skip


def shown_walk(results: Results) -> tuple[Walk, int]:
    """The walk that the paper's figures are drawn from, and the cycle: its last."""
    run = results.select(part=LADDER, controller=ALL).run
    return measured.walk_in(run.folder), run.whole_cycles


def values(results: Results) -> dict[str, Any]:
    """Settings of the runs, and when Fig. 17 to 20 are."""
    printed, (walk, cycle) = results.select(part=LADDER, controller=PRINTED), shown_walk(results)
    began = walk.view.time[walk.view.cycle == cycle][0]
    times = {f"fig{n}": float(walk.view.time[k] - began) for n, k in instants(walk, cycle).items()}
    return times | {
        "last": cycle, "late": LATE, "depth": figures.DEPRESSION_SCALE, "cycles": printed.value("cycles"),
        "long": results.select(part=LONG).value("cycles"), "cmac_from": printed.value("learning.start_cycle"),
        "noises": ", ".join(f"`sensors.{key}={level}`" for key, level in NOISES.items()),
        "hip_height": 1e3 * printed.value("machine.hip_height"), "length": 1e3 * walk.length,
    }  # fmt: skip


def draw_views(results: Results, number: int) -> "Figure":
    """Fig. 16 to 20."""
    return figures.views(*shown_walk(results), number)


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
        "fig15": lambda r: figures.diagram(shown_walk(r)[0]),
        **{f"fig{number}": partial(draw_views, number=number) for number in range(16, 21)},
        "learning": lambda r: draw_cycles(
            r.select(part=LADDER, controller=[ALL, PRINTED, NO_CMAC]),
            ("feedforward_share", "tilt_max", "transfer_rmse_y", "force_rmse_three_feet"), by="controller",
        ),
        "long": lambda r: draw_cycles(
            r.select(part=LONG), ("transfer_rmse_x", "transfer_rmse_y", "feedback_rms"), by="law", columns=3
        ),
    },
    tables={
        "ladder": lambda r: tabulate(
            r.select(part=LADDER), {"controller": "controller"},
            {"walk to the end": completed, **ends((*ERRORS, "feedforward_share", "tilt_max"), LATE)},
        ),
        "noise": lambda r: r.computed["noise"].drop(columns="seed").groupby("controller", as_index=False).mean(),
    },
    values=values,
)  # fmt: skip

if __name__ == "__main__":
    main(__file__)
