"""Ground in patches, and slopes: how much of either a machine that does not know of them walks over."""

from collections.abc import Sequence

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Drawing, Section, Table, Text
from pipelines.analysis import figures_terrain as figures
from pipelines.analysis.measured import digits
from pipelines.analysis.terrain_measures import BODY, FEEDFORWARDS, LASTING, Walked, errors_of
from pipelines.shared.runs import Runs
from pipelines.shared.stats import Spread, spread
from pipelines.shared.study import Jobs

SPREADS = (0.0, 0.2, 0.4, 0.6, 0.8)
SEEDS = range(5)
SLOPES = (-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2)
START, START_QUICK = 10.0, 2.0
"""Where a slope begins, m: some 25 and 4 cycles after learning began."""
LAST = 5
"""Cycles at the end that count."""
TILT = 0.05
"""Largest tilt, rad, at which a walk on a slope counts as level."""


def _walk(feedforward: str, cycles: int, *more: str) -> list[str]:
    return [
        "scenario=quadruped",
        *LASTING,
        f"feedforward={feedforward}",
        f"cycles={cycles}",
        "record.cycles=[1]",
        *more,
    ]


def jobs(quick: bool) -> Jobs:
    """Patches of every spread and seed, slopes up and down, each with and without CMAC."""
    cycles = 15 if quick else 60
    spreads, seeds, slopes = ((0.0, 0.4), range(2), (-0.1, 0.0, 0.1)) if quick else (SPREADS, SEEDS, SLOPES)
    runs = {}
    for words, feedforward in FEEDFORWARDS.items():
        for wide in spreads:
            for seed in seeds if wide else [0]:
                ground = (f"terrain.patch_spread={wide}", "terrain.patch_size=0.15", f"terrain.patch_seed={seed}")
                runs[f"patches {wide} {seed} {words}"] = _walk(feedforward, cycles, *ground)
        for slope in slopes:
            start = [f"terrain.slope_start={START_QUICK if quick else START}"] if slope else []
            runs[f"slope {slope} {words}"] = _walk(feedforward, cycles, f"terrain.slope={slope}", *start)
    return runs


def walked(ground: float, runs: Sequence[StoredRun]) -> Walked:
    """Results of runs on the same kind of ground; errors are of those that completed."""
    ends = [errors_of(run, BODY).iloc[-LAST:] for run in runs if run.status == "completed"]
    force = spread([float(np.sqrt((end["force_rmse_cycle"] ** 2).mean())) for end in ends])
    return Walked(ground, len(runs), len(ends), force, spread([float(end["tilt_max"].max()) for end in ends]))


def _on(runs: Runs, kind: str, words: str) -> list[Walked]:
    """Runs of a kind of ground, from its least value to its largest."""
    found: dict[float, list[StoredRun]] = {}
    for name, run in runs.items():
        if name.startswith(kind) and name.endswith(words):
            found.setdefault(float(name.split()[1]), []).append(run)
    return [walked(ground, found[ground]) for ground in sorted(found)]


def _cell(each: Walked, value: Spread) -> str:
    return str(value) if each.walked else "-"


def _table(by_words: dict[str, list[Walked]], ground: str, caption: str) -> Table:
    columns = [ground, "", "walk to the end", "force error, N", "tilt, mrad"]
    rows = [
        [
            f"{each.ground:g}",
            words,
            f"{each.walked} of {each.runs}",
            *(_cell(each, value) for value in (each.force, each.tilt)),
        ]
        for words, own in by_words.items()
        for each in own
    ]
    return Table(columns, rows, caption, text_columns=2)


def patches_advice(by_words: dict[str, list[Walked]]) -> str:
    """Up to which spread learning keeps the force error below that of feedback alone."""
    learned, alone = ({each.ground: each for each in by_words[words]} for words in FEEDFORWARDS)
    fell = [g for g, each in learned.items() if each.walked < each.runs]
    good = [g for g, each in learned.items() if g not in fell and each.force.mean < alone[g].force.mean]
    if not good:
        return "On patches leave the CMAC off: it presses no better than feedback alone."
    even, widest = learned[min(learned)].force.mean, learned[max(good)]
    said = (
        f"Patches need no map: up to a spread of {widest.ground:g} learning presses better than feedback alone, at a "
        f"force error of {digits(widest.force.mean)} N there, {digits(even)} N on even ground"
    )
    return said + (f"; from a spread of {min(fell):g} on some walks end early." if fell else ".")


def _steepest(own: list[Walked], sign: float) -> float:
    """The steepest slope up (1) or down (-1) to which every slope is walked without leaning."""
    steepest = 0.0
    for each in sorted((each for each in own if sign * each.ground > 0.0), key=lambda each: abs(each.ground)):
        if each.walked < each.runs or each.tilt.mean > 1e3 * TILT:
            break
        steepest = each.ground
    return steepest


def slope_advice(by_words: dict[str, list[Walked]]) -> str:
    """How steep a slope may be."""
    up, down = (abs(_steepest(by_words["with CMAC"], sign)) for sign in (1.0, -1.0))
    alone = by_words["feedback alone"]
    flat = next(each.tilt.mean for each in alone if each.ground == 0.0)
    if flat > 1e3 * TILT:
        said = f"feedback alone leans by {flat:.0f} mrad on flat ground already"
    else:
        reached = (abs(_steepest(alone, sign)) for sign in (1.0, -1.0))
        said = "feedback alone keeps that up to {:.0%} and {:.0%}".format(*reached)
    outlived = [
        each.ground
        for each, learned in zip(alone, by_words["with CMAC"], strict=False)
        if learned.walked < learned.runs and each.walked == each.runs
    ]
    ends = f" At {' and '.join(f'{slope:.0%}' for slope in outlived)} learning falls where feedback alone walks on."
    return (
        f"With CMAC a plan for flat ground does up to {up:.0%} uphill and {down:.0%} downhill (tilt at most "
        f"{1e3 * TILT:g} mrad); {said}. On steeper ground the plan has to know the slope."
    ) + (ends if outlived else "")


def sections(runs: Runs) -> list[Section]:
    """Patches and slopes, each with advice."""
    start = max(run.config["terrain"]["slope_start"] for run in runs.values())
    patches, slopes = ({words: _on(runs, kind, words) for words in FEEDFORWARDS} for kind in ("patches", "slope"))
    return [
        Section(
            "Patches",
            [
                Text(
                    "Squares of 0.15 m, each with K_n times a factor between 1 - spread and 1 + spread. Mean "
                    f"and 95 % interval over seeds, of the last {LAST} cycles of walks that completed."
                ),
                Drawing(
                    "patches",
                    figures.over_ground(patches, "spread of the patches"),
                    "Force error and tilt on patches; a cross marks ground on which walks end early.",
                ),
                _table(patches, "spread", "Walks over patches"),
                Text(patches_advice(patches)),
            ],
            beyond=True,
        ),
        Section(
            "Slopes",
            [
                Text(
                    f"The ground rises or falls from {start:g} m on; the planner assumes flat ground, so the "
                    "front feet touch down early uphill and late downhill. Contact forces stay vertical, without "
                    "friction."
                ),
                Drawing(
                    "slopes",
                    figures.over_ground(slopes, "slope, m/m"),
                    "Force error and tilt on slopes; a cross marks a slope on which the walk ends early.",
                ),
                _table(slopes, "slope", "Walks up and down"),
                Text(slope_advice(slopes)),
            ],
            beyond=True,
        ),
    ]
