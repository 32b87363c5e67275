"""How much of what was learnt remains on another ground, or with another stroke."""

from collections.abc import Mapping

import numpy as np

from cmacexp.report.page import Claim, Table
from pipelines.analysis.feedforward_kinds import (
    ALONE,
    CHANGES,
    CMAC,
    KEPT,
    KINDS,
    Course,
    courses,
    level,
    of_kind,
    ranked,
    spread,
)
from pipelines.analysis.measured import digits, listed
from pipelines.shared.runs import Runs

MOSTLY, BARELY = 0.25, 0.75
"""Share of the error of feedback alone, left with another stroke, up to which a CMAC generalises, or does in part."""
CARRIED = "carried to "
CAPTION = (
    "Transfer error in the plane after the change; solid: with what was learnt before, dashed: from nothing; grey: "
    "feedback alone."
)


def carried(name: str) -> str:
    """Name of the run after a change that starts from what was learnt before it."""
    return CARRIED + name


def all_courses(runs: Runs) -> dict[str, tuple[dict[str, Course], dict[str, Course]]]:
    """Of each change the courses from nothing, and those with what was learnt before."""
    return {group: (courses(runs, group), courses(runs, carried(group))) for group in CHANGES}


def left_at_first(fresh: Mapping[str, Course], kept: Mapping[str, Course]) -> dict[str, np.ndarray]:
    """Transfer error of the first cycle over that of feedback alone in it, by kind; (seeds,)."""
    alone = float(fresh[ALONE].error[0, 0])
    acting = {kind: course for kind, course in fresh.items() if kind not in KEPT} | dict(kept)
    return {kind: course.error[:, 0] / alone for kind, course in acting.items()}


def tables(runs: Runs) -> list[Table]:
    """Of each change: first error, cycles to a tenth with and without what was learnt, last error."""
    found = []
    for group, (fresh, kept) in all_courses(runs).items():
        first, tenth = left_at_first(fresh, kept), level(fresh[ALONE])
        rows = []
        for kind in KINDS:
            if kind not in first:
                continue
            course = kept.get(kind, fresh[kind])
            values = [spread(course.error[:, 0]), spread(first[kind])]
            learns = kind in kept
            values += [spread(c.cycles_to(tenth), ".0f") if learns else "-" for c in (course, fresh[kind])]
            rows.append([kind, *values, spread(course.error[:, -1])])
        last = fresh[ALONE].error.shape[1]
        columns = ["feedforward", "cycle 1, mm", "of feedback alone", "learnt, carried over", "learnt, from nothing"]
        found.append(Table([*columns, f"cycle {last}, mm"], rows, group[0].upper() + group[1:]))
    return found


def left_by_stroke(runs: Runs) -> dict[str, float]:
    """Transfer error of the first cycle over that of feedback alone, mean over strokes and seeds, by learner."""
    lefts = [left_at_first(*own) for name, own in all_courses(runs).items() if name.startswith("stroke")]
    return {kind: float(np.mean([left[kind].mean() for left in lefts])) for kind in KEPT}


def verdict_of(left: float) -> str:
    """Whether so much of the error of feedback alone is what generalisation leaves."""
    return "reproduced" if left <= MOSTLY else "reproduced in part" if left <= BARELY else "not reproduced"


def claim(runs: Runs) -> Claim:
    """What the paper says of generalisation, on another stroke."""
    left = left_by_stroke(runs)
    strokes = [name for name in CHANGES if name.startswith("stroke")]
    return Claim(
        "CMAC generalises: it generates similar outputs for similar inputs",
        "section 1",
        "Trained with a stroke of 200 mm, error of the first cycle with 150 and 250 mm over that of feedback alone: "
        + ", ".join(f"{kind} {left[kind]:.0%}" for kind in KEPT)
        + f" (criterion for CMAC: at most {MOSTLY:.0%}; in part: at most {BARELY:.0%})",
        verdict_of(left[CMAC]),
        runs.links(*(name for stroke in strokes for name in list(of_kind(runs, carried(stroke), CMAC))[:1])),
    )


def advice(runs: Runs) -> str:
    """What to take where ground or path change."""
    found = all_courses(runs)
    strokes = [name for name in found if name.startswith("stroke")]
    first = {name: left_at_first(*found[name]) for name in found}
    left = left_by_stroke(runs)
    ground = {
        kind: float(np.mean([first[name][kind].mean() for name in found if name not in strokes])) for kind in KEPT
    }
    order = ranked(left)
    other = [kind for kind in order if left[kind] < left[CMAC]]
    beats = f"{listed(other)} carry more over than CMAC does. " if other else "None carries more over than CMAC. "
    return (
        "In the first cycle with another stroke "
        + ", ".join(f"{kind} has {left[kind]:.0%}" for kind in order)
        + " of the error of feedback alone; on another ground "
        + ", ".join(f"{kind} {ground[kind]:.0%}" for kind in ranked(ground))
        + f". {beats}ILC knows samples, not joint values: it carries over what has the same place in the cycle, as "
        "far as the new path asks for the same torque there. A CMAC on another path reads some cells that it never "
        "trained; Gaussians and perceptron interpolate. A model knows the new path at once. Advice: where paths "
        f"change, take {order[0]} (mean error left {digits(100 * left[order[0]])} %), or begin with a model; keep "
        "the weights (record.weights) rather than learning from nothing."
    )
