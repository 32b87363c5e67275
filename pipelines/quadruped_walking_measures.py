"""What the walk is judged by: a value for each run, of its events, of its metrics, or of what noise changes."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.study import Results
from cmacexp.typing import Array
from pipelines.quadruped_walking_events import LATE, Walk, events_in, walk_in

if TYPE_CHECKING:
    import pandas as pd

LADDER, NOISE, LONG = "ladder", "noise", "long"
"""Parts of the study."""
FEEDBACK, NO_POSTURE, NO_CMAC = "feedback", "feedback + CMAC", "feedback + posture"
ALL, PRINTED = "all, aware reference", "all, eq. 24 as printed"
PUBLISHED, LEAD = "as published", "lead of one sample"
UNSEEDED = (FEEDBACK, NO_CMAC)
"""Controllers that learn nothing, so that with perfect sensors no seed matters."""
Sample = Callable[[Results], Array]


def in_part(results: Results, part: str) -> Results:
    """The runs of a part of the study."""
    return results.select(part=part)


def shown_walk(results: Results) -> tuple[Walk, int]:
    """The walk that the paper's figures are drawn from, and the cycle: its last."""
    run = in_part(results, LADDER).select(controller=ALL).run
    return walk_in(run.folder), run.whole_cycles


def events(results: Results) -> "pd.DataFrame":
    """The events of the full controllers: one row per run and whole cycle."""
    import pandas as pd

    own = in_part(results, LADDER).select(controller=[ALL, PRINTED])
    keys = [{name: row.settings[name] for name in ("controller", "seed")} for row in own.rows]
    return pd.concat(
        [events_in(run).assign(**key) for run, key in zip(own.runs, keys, strict=True)], ignore_index=True
    )


def _event(results: Results, column: str) -> list[Array]:
    """A column of the events, an array over cycles for each of these runs."""
    table = results.computed["events"]
    return [
        table[(table["controller"] == row.settings["controller"]) & (table["seed"] == row.settings["seed"])][
            column
        ].to_numpy()
        for row in results.rows
    ]


def at_end(column: str, worst: float = 0.0) -> Sample:
    """Median of an event over the last cycles of each run; ``worst`` of a run that did not complete."""

    def sample(results: Results) -> Array:
        found = zip(results.completed, _event(results, column), strict=True)
        return np.array([float(np.median(values[-LATE:])) if done else worst for done, values in found])

    return sample


def over_cycles(column: str, reduce: Callable[[Array], float]) -> Sample:
    """An event reduced over all cycles of each run."""
    return lambda results: np.array([reduce(values) for values in _event(results, column)])


def walked(results: Results) -> Array:
    """(runs,): whole cycles over those asked for."""
    walk: Array = np.array(results.cycles) / results.value("cycles")
    return walk


def height_off(results: Results) -> Array:
    """(runs,): largest departure from the planned height in the last cycles, as a part of it; inf if a run ended."""
    planned = float(results.value("machine.hip_height"))
    extremes = zip(results.completed, results.history("height_min"), results.history("height_max"), strict=True)
    off = [
        max(planned - least[-LATE:].min(), most[-LATE:].max() - planned) / planned if done else np.inf
        for done, least, most in extremes
    ]
    return np.array(off)


def bursts(results: Results) -> Array:
    """(runs,): largest transfer error in x in the last fifth of the cycles over its median in the second fifth; inf
    if a run ended."""
    fifth = int(results.value("cycles")) // 5
    found = zip(results.completed, results.history("transfer_rmse_x"), strict=True)
    return np.array([e[-fifth:].max() / np.median(e[fifth : 2 * fifth]) if done else np.inf for done, e in found])


def least_force_at_fall(results: Results) -> Array:
    """(runs,): least force of a foot that is planned to support in the last step, over the weight; inf if a run did
    not fall."""
    found = []
    for run in results.runs:
        last = run.trace.tail(4)
        least = float(last.loc[last["phase"] == "support", "force"].min())
        found.append(least / run.config["machine"]["weight"] if run.status == "fell" else np.inf)
    return np.array(found)


def deviations(results: Results) -> "pd.DataFrame":
    """What noise changes in the last cycles, by controller and seed: ``feet``, mm, and ``force``, N.

    RMS over all samples and legs of the difference from the run with perfect sensors, the same controller and seed;
    infinite if either run did not complete.
    """
    import pandas as pd

    noisy, perfect = in_part(results, NOISE), in_part(results, LADDER)
    rows = []
    for row, run in zip(noisy.rows, noisy.runs, strict=True):
        controller, seed = row.settings["controller"], row.settings["seed"]
        same = {"controller": controller} | ({} if controller in UNSEEDED else {"seed": seed})
        reference = perfect.select(same).run
        found = {"feet": np.inf, "force": np.inf}
        if run.status == reference.status == "completed":
            cycles = range(max(1, run.whole_cycles - LATE + 1), run.whole_cycles + 1)
            change = (run.cycles(cycles)[["x", "y", "force"]] - reference.cycles(cycles)[["x", "y", "force"]]) ** 2
            squares = change.mean()
            found = {"feet": 1e3 * float(squares["x"] + squares["y"]) ** 0.5, "force": float(squares["force"]) ** 0.5}
        rows.append({"controller": controller, "seed": seed, **found})
    return pd.DataFrame(rows)


def noise_ratio(column: str) -> Sample:
    """What noise changes with CMAC, over what they change without; one value for each seed."""

    def sample(results: Results) -> Array:
        by_seed = results.computed["noise"].pivot_table(index="seed", columns="controller", values=column)
        ratio: Array = (by_seed[ALL] / by_seed[NO_CMAC]).to_numpy()
        return ratio

    return sample
