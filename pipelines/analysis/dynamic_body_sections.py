"""Sections of the study of a body with mass."""

from collections.abc import Sequence

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Claim, Drawing, Section, Table, Text
from pipelines.analysis import figures_dynamic as figures
from pipelines.analysis.dynamic_body_words import (
    ALL,
    BASE,
    BUT,
    CUT_OFF,
    FEEDBACK,
    LATE,
    PAPER,
    START,
    Walk,
    alone,
    by_cycle,
    first,
    force_errors,
    last_cycle,
    low_passed,
    plain,
    walk_at,
    whole_cycles,
    without,
)
from pipelines.analysis.measured import listed
from pipelines.shared.runs import Runs

BETTER_FORCE, BETTER_SLOW = 0.45, 0.35
"""Force error over that of feedback alone that counts as better: whole, and slower than CUT_OFF."""
MOST_X, MOST_Y, MOST_TILT = 3.0, 1.5, 10.0
"""Transfer errors, mm, and tilt, mrad, of a walk that has learnt."""
OFF_COURSE, LATER = 0.05, 1.1
"""Largest relative error of the advance; largest force error late over that early."""
FELT = 1.1
"""A change counts as felt if leaving it out multiplies the force error by at least this."""
SHOWN_LEG = 2
WHERE = "section 6, with a dynamic body"


def judged(good: Sequence[bool]) -> str:
    """All, some or none."""
    return "reproduced" if all(good) else "reproduced in part" if any(good) else "not reproduced"


def walked(run: StoredRun) -> Walk:
    """The last cycle of a run."""
    return walk_at(run, last_cycle(run))


def _row(name: str, walk: Walk) -> list[str]:
    if not np.isfinite(walk.force):
        return [name, f"{walk.status} at {walk.seconds:.1f} s", *["-"] * 6]
    numbers = (walk.force, walk.slow, walk.x, walk.y, walk.tilt)
    return [name, walk.status, *(f"{value:.2f}" for value in numbers), f"{walk.advance:.3f}"]


COLUMNS = [
    "walk", "ends", "force RMSE, N", f"below {CUT_OFF:g} Hz, N", "transfer x, mm", "transfer y, mm", "tilt, mrad",
    "advance / plan",
]  # fmt: skip


def falls_section(runs: Runs) -> Section:
    """The constants of the paper."""
    names = [name for name in runs if name.startswith(PAPER)]
    walks = {name: walked(runs[name]) for name in names}
    rows = [
        [name.removeprefix(f"{PAPER}, "), walk.status, f"{walk.seconds:.2f}", runs[name].manifest["cause"]]
        for name, walk in walks.items()
    ]
    learnt = {name: walk for name, walk in walks.items() if not name.endswith(FEEDBACK) and BUT not in name}
    ended = [walk.seconds for walk in learnt.values() if walk.status != "completed"]
    alone_too = all(walk.status != "completed" for name, walk in walks.items() if name.endswith(FEEDBACK))
    said = f"{len(ended)} of {len(learnt)} variants with a feedforward fall or diverge" + (
        f", after {min(ended):.2f} to {max(ended):.2f} s" if ended else ""
    )
    verdict = "contradicted" if len(ended) == len(learnt) else "reproduced in part" if ended else "reproduced"
    claim = Claim(
        "with the constants of the paper the machine walks", "section 6", said, verdict, runs.links(*learnt)
    )
    finer = [walk for name, walk in walks.items() if name.endswith("finer") and walk.status != "completed"]
    saved = sorted({n.partition(BUT)[2] for n, w in walks.items() if BUT in n and w.status == "completed"})
    end = (
        "The paper's constants are for a body that is in balance in every instant. "
        + ("With one that has mass feedback alone falls as well: no way of learning can help. " if alone_too else "")
        + ("It is not the integration: in finer steps it ends likewise. " if alone_too and finer else "")
        + (f"Of the paper's constants one is to blame: it stands with {listed(saved)}." if saved else "")
    )
    table = Table(["reference, feedforward", "ends", "after, s", "cause"], rows, "Sampled at 5 ms, LEAD 10/10", 2)
    return Section("A body with mass falls with the paper's constants", [table, Text(end)], [claim])


def _span(walks: Sequence[Walk], name: str) -> str:
    """From the least to the most."""
    values = [getattr(walk, name) for walk in walks]
    return f"{min(values):.0f} to {max(values):.0f}"


def walks_section(runs: Runs) -> Section:
    """Sampled faster, with less LEAD and the desired force as feedforward, and nothing else changed."""
    names = [name for name in runs if name.startswith(plain(""))]
    walks = {name.removeprefix(plain("")): walk_at(runs[name], whole_cycles(runs[name])) for name in names}
    felt, *learnt = walks.values()
    links = runs.links(*names)
    better = [getattr(walk, axis) < getattr(felt, axis) for walk in learnt for axis in ("x", "y")]
    stronger = [walk.force < felt.force for walk in learnt]
    claims = [
        Claim(
            "learning makes foot positions better", "sections 6, 7",
            f"transfer {_span(learnt, 'x')} / {_span(learnt, 'y')} mm against {felt.x:.0f} / {felt.y:.0f} mm with "
            "feedback alone",
            judged(better), links,
        ),
        Claim(
            "learning makes the contact forces better", "sections 6, 7",
            f"force RMSE {_span(learnt, 'force')} N against {felt.force:.1f} N with feedback alone",
            judged(stronger) if any(stronger) else "contradicted", links,
        ),
    ]  # fmt: skip
    rows = [
        [*_row(name, walk), str(whole_cycles(runs[plain(name)])), f"{walk.seconds:.0f}"]
        for name, walk in walks.items()
    ]
    table = Table([*COLUMNS, "cycle", "walked, s"], rows, "The last whole cycle of each walk", 2)
    forces = (
        "not in every walk do its contact forces get better."
        if any(stronger)
        else "its contact forces get worse: learning excites an undamped body."
    )
    intro = "Sampled at 2 ms, with LEAD 10/3 and the desired force as part of the feedback; nothing else is changed."
    parts = [Text(intro), table, Text(f"The machine learns where to put its feet, but {forces}")]
    return Section("Sampled faster it walks, but forces get worse", parts, claims)


def _pair(runs: Runs, name: str) -> tuple[Walk, Walk]:
    return walked(runs[name]), walked(runs[alone(name)])


def _learning(runs: Runs, names: Sequence[str]) -> Drawing:
    tables = {name: by_cycle(runs[name]) for name in names}
    felt = {name: by_cycle(runs[alone(name)]).iloc[-1] for name in names}
    caption = "Errors by cycle; dotted: feedback alone on the same plan. A line that ends early fell."
    return Drawing("dynamic_learning", figures.learning(tables, felt), caption)


def _slow_force(runs: Runs) -> Drawing:
    shown = {"feedback alone": runs[alone(ALL)], "CMAC": runs[ALL]}
    drawn = {}
    for name, run in shown.items():
        time, desired, error = force_errors(run, last_cycle(run))
        slow = desired + low_passed(error, run.config["sampling_period"])
        drawn[f"{name}, cycle {last_cycle(run)}"] = (time, desired, slow, desired + error)
    caption = "Contact force of one foot with all changes; blue: desired force plus the slow part of the error."
    return Drawing("dynamic_slow_force", figures.slow_force(drawn, SHOWN_LEG), caption)


def _full_claims(runs: Runs, names: Sequence[str]) -> list[Claim]:
    learnt, felt = _pair(runs, ALL)
    cycle, links = last_cycle(runs[ALL]), runs.links(ALL, alone(ALL))
    rate = names[0]
    undamped, undamped_felt = _pair(runs, without(rate))
    worse = not undamped.force <= undamped_felt.force
    ratios = (learnt.force / felt.force, learnt.slow / felt.slow)
    return [
        Claim(
            "with all changes learning makes the contact forces better too", WHERE,
            f"cycle {cycle}: {learnt.force:.2f} N against {felt.force:.2f} N with feedback alone on the same plan "
            f"({ratios[0]:.2f}; {BETTER_FORCE} asked for), below {CUT_OFF:g} Hz {ratios[1]:.2f} ({BETTER_SLOW})",
            judged([ratios[0] <= BETTER_FORCE, ratios[1] <= BETTER_SLOW]), links,
        ),
        Claim(
            "positions and posture stay as good", WHERE,
            f"cycle {cycle}: transfer {learnt.x:.2f} / {learnt.y:.2f} mm, tilt {learnt.tilt:.1f} mrad, advance "
            f"{learnt.advance:.3f} of the plan",
            judged([
                learnt.x <= MOST_X, learnt.y <= MOST_Y, learnt.tilt <= MOST_TILT,
                abs(learnt.advance - 1.0) <= OFF_COURSE,
            ]),
            links,
        ),
        Claim(
            f"without the {rate} it is worse than feedback alone", WHERE,
            f"{undamped.force:.1f} N against {undamped_felt.force:.1f} N" if np.isfinite(undamped.force)
            else f"{undamped.status} at {undamped.seconds:.0f} s",
            "reproduced" if worse else "contradicted", runs.links(without(rate), alone(without(rate))),
        ),
    ]  # fmt: skip


def ladder_section(runs: Runs, names: Sequence[str]) -> Section:
    """Which changes make forces better: added one after the other, and left out one at a time."""
    steps = {BASE: BASE, **{f"+ {names[n - 1]}": first(list(names[:n])) for n in range(1, len(names))}}
    up = [(label, *_pair(runs, name)) for label, name in steps.items() if name in runs]
    up.append((f"+ {names[-1]}", *_pair(runs, ALL)))
    down = [("all changes", *_pair(runs, ALL))]
    down += [(f"without {name}", *_pair(runs, without(name))) for name in names if without(name) in runs]
    bars = Drawing(
        "dynamic_ladder",
        figures.ladder(up, down),
        "Force error in the last cycle, pale: what of it is slow; grey ticks: feedback alone on the same plan. "
        "Red: worse than that.",
    )
    table = Table(
        COLUMNS,
        [_row(*each) for label, a, b in [*up, *down] for each in ((label, a), (f"{label}, feedback alone", b))],
        "Every walk",
        2,
    )
    full = up[-1][1]
    cost = {label.removeprefix("without "): walk.force / full.force for label, walk, _ in down[1:]}
    ordered = sorted(cost, key=lambda name: -cost[name] if np.isfinite(cost[name]) else -np.inf)
    idle = [name for name in ordered if cost[name] < FELT]
    said = ", ".join(f"{name} {cost[name]:.1f}" if np.isfinite(cost[name]) else f"{name} (falls)" for name in ordered)
    end = (
        f"How many times as large the force error of cycle {last_cycle(runs[ALL])} is when one change is left out: "
        + said
        + "."
        + (f" Of no weight so early: {listed(idle)}." if idle else "")
    )
    shown = [name for name in (BASE, without(names[0]), ALL) if name in runs]
    return Section(
        "Which changes let learning improve the forces",
        [bars, _learning(runs, shown), _slow_force(runs), table, Text(end)],
        _full_claims(runs, names),
    )


def starts_section(runs: Runs) -> Section:
    """Slightly disturbed starts, walked for long."""
    names = [name for name in runs if name.startswith(START)]
    felt, cycle = walked(runs[alone(ALL)]), last_cycle(runs[ALL])
    early, late = ([walk_at(runs[n], c) for n in names] for c in (cycle, last_cycle(runs[names[0]])))
    rows = [
        [n.removeprefix(f"{START} "), *_row("", a)[1:], f"{b.force:.2f}", f"{b.advance:.3f}", f"{b.yaw:.3f}"]
        for n, a, b in zip(names, early, late, strict=True)
    ]
    long = last_cycle(runs[names[0]])
    columns = ["start", *COLUMNS[1:], f"force in cycle {long}, N", f"advance in cycle {long}", "yaw then, rad"]
    good = [
        all(
            (
                b.status == "completed",
                a.force <= BETTER_FORCE * felt.force, a.slow <= BETTER_SLOW * felt.slow,
                a.x <= MOST_X, a.y <= MOST_Y, a.tilt <= MOST_TILT,
                abs(a.advance - 1.0) <= OFF_COURSE, abs(b.advance - 1.0) <= OFF_COURSE, b.force <= LATER * a.force,
            )
        )
        for a, b in zip(early, late, strict=True)
    ]  # fmt: skip
    claim = Claim(
        f"it walks {long} cycles from {len(names)} disturbed starts, and what it learnt lasts", WHERE,
        f"{sum(b.status == 'completed' for b in late)} of {len(names)} complete, {sum(good)} meet every bound; "
        f"force RMSE at most {max(a.force for a in early):.2f} N in cycle {cycle}, "
        f"{max(b.force for b in late):.2f} N in cycle {long}",
        judged(good), runs.links(*names),
    )  # fmt: skip
    intro = f"Every joint starts up to {runs[names[0]].config['plant']['start_spread']:g} rad off the plan."
    leadless = walk_at(runs[LATE], long)
    yaw = max(abs(b.yaw) for b in late)
    end = (
        f"Force errors of the starts differ by at most {np.ptp([b.force for b in late]):.2f} N in cycle {long}; yaw, "
        f"which nothing controls, is {yaw:.3f} rad at most. Without lead the force error there is "
        + (f"{leadless.force:.2f} N." if np.isfinite(leadless.force) else f"not reached: {leadless.status}.")
    )
    table = Table(columns, rows, f"Cycle {cycle} of every start, and cycle {long}", 2)
    return Section("Ten starts", [Text(intro), table, Text(end)], [claim])
