"""The log track of the benchmark: methods learn from the strokes of a log and predict the torque of the next stroke.

``python -m pipelines.benchmark --log LOG --robot go2``; the protocol is that of ``cmacexp gap``.
"""

import hashlib
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.addons.gap.analysis import Gap, add_makers, list_scored, measure, measure_left, score
from cmacexp.addons.gap.command import read_given
from cmacexp.addons.gap.learners import Entered, Maker, predict_all
from cmacexp.addons.gap.machine import read_machine
from cmacexp.addons.gap.validation import ABOVE, IDENTIFIED, choose_level, list_identified
from cmacexp.addons.study.command import Options, write_results
from cmacexp.addons.study.provenance import digest_files, make_provenance
from cmacexp.addons.study.study_file import StudyFile
from cmacexp.commands.command import Arguments
from cmacexp.config.component import find_class
from cmacexp.data.own_files import HTML
from cmacexp.engine.driver import map_runs
from cmacexp.engine.workers import Here
from cmacexp.errors import describe_failure, require
from cmacexp.study import Array, Criterion, Finding, Results, Study, at_most
from pipelines.benchmark.entrants import choose, slug
from pipelines.benchmark.simulated_log import MODEL, NAMES, simulate_log

NAME, SCORES = "log_track", "log_scores"
VERSION = 2
"""Version of the benchmark that added this track; its other tasks are those of version 1."""
SIMULATED = "simulated"
"""Value of ``--log`` that selects a simulated log."""
UPDATED, FROZEN, GUARDED = SETTINGS = ("updated", "frozen", "guarded")
"""Learning after every stroke; until half of the strokes; after every stroke, but off after a harmful one."""
ALONE = (IDENTIFIED,)
WITH_ILC, WITH_CMAC = f"{IDENTIFIED}, and ILC", f"{IDENTIFIED}, and {ABOVE}"
TABLES = (
    "stroke before", "ILC", "norm-optimal ILC", "CMAC over phase", "CMAC over angles and velocities",
    "CMAC over phase and speed", "RBF over phase", "random Fourier features", "regressor of the model", "perceptron",
)  # fmt: skip
METHODS = (
    *TABLES, "model", "model and CMAC over phase", "generic joints", "generic joints and CMAC over phase",
    IDENTIFIED, WITH_ILC, WITH_CMAC,
)  # fmt: skip


def try_method(gap: Gap, name: str, make: Maker, setting: str) -> dict[str, Any]:
    """Score one method with one setting on a log, and return its row.

    ``left`` is the torque that remains in each stroke, %. A method that raises has failed; ``cause`` describes the
    error. A guarded method is switched off after the first stroke in which more than 100 % remains.
    """
    signals = gap.signals
    cause = ""
    scores = dict[str, Any]()
    strokes = range(1, signals.count + 1)
    try:
        predicted = predict_all(make(), signals, signals.count // 2 if setting == FROZEN else None)
        harmful = [stroke for stroke in strokes if measure_left(signals, predicted, stroke) > 100.0]
        if harmful and setting == GUARDED:
            predicted[signals.rows(harmful[0]).stop :] = 0.0
        for prefix, scored in {"": list_scored(signals), "fastest ": [signals.fastest]}.items():
            scores |= {f"{prefix}{key}": value for key, value in score(gap, predicted, scored).items()}
    except Exception as error:
        predicted = np.full_like(signals.torque, np.inf)
        cause = describe_failure(error)
    left = [measure_left(signals, predicted, stroke) for stroke in strokes]
    return {
        "method": name,
        "setting": setting,
        "status": "failed" if cause else "completed",
        "cause": cause,
        "value": np.nan,
        **scores,
        "harmful": sum(percent > 100.0 for percent in left),
        "left": left,
    }


def _divide(one: str, other: str, setting: str, results: Results) -> Array:
    """Return the remaining torque of one method relative to another's in each predicted stroke; inf if it failed."""
    rows = results.computed[SCORES].query("setting == @setting").set_index("method")["left"]
    left, reference = (pd.Series(rows[name]) for name in (one, other))
    after = len(left) // 2 if setting == FROZEN else 2
    return (left / reference)[after:].fillna(np.inf).to_numpy()


def _compare(one: str, rivals: Sequence[str], limit: float, setting: str, names: Sequence[str]) -> list[Criterion]:
    """Return a criterion for the ratio of one method to each rival, where both are among ``names``."""
    return [
        Criterion(
            f"torque left over that of the other method, {setting}",
            partial(_divide, one, other, setting),
            at_most(limit),
            case=other,
            infinite="a method failed",
        )
        for other in rivals
        if {one, other} <= {*names}
    ]


def tabulate(scores: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the remaining torque of each method by setting, from a row of scores for each method and setting."""

    def show(prefix: str, setting: str) -> pd.Series:
        columns = [f"{prefix}{end}" for end in ("value", "low", "high")]
        return by_setting[setting].apply(
            lambda row: "failed" if row["cause"] else "{:.1f} [{:.1f}, {:.1f}]".format(*row[columns]), axis=1
        )

    by_setting = {setting: rows.set_index("method") for setting, rows in scores.groupby("setting")}
    table = pd.DataFrame(
        {
            "left, %": show("", UPDATED),
            "fastest, %": show("fastest ", UPDATED),
            "fastest if frozen, %": show("fastest ", FROZEN),
            "guarded, %": show("", GUARDED),
            "harmful strokes": by_setting[UPDATED]["harmful"],
            "failed": (scores["cause"] != "").groupby(scores["method"]).sum().map(f"{{}} of {len(SETTINGS)}".format),
        }
    )
    return table.loc[by_setting[UPDATED].sort_values("value").index].rename_axis("method").reset_index()


def make_study(names: Sequence[str] = METHODS, values: Mapping[str, Any] | None = None) -> StudyFile:
    """Return the log track as a study of the methods ``names``; ``values`` are further values of its page."""
    stated = {
        "identified": (
            "An identified plant leaves less torque than any table or network",
            IDENTIFIED,
            TABLES,
            1.0,
            UPDATED,
        ),
        "carries": (
            "An identified plant, frozen at half of the strokes, leaves at most half of what others leave in those "
            "that follow",
            IDENTIFIED,
            TABLES,
            0.5,
            FROZEN,
        ),
        "above": (
            "An identified plant below a CMAC leaves at most 95 % of what it leaves alone",
            WITH_CMAC,
            ALONE,
            0.95,
            UPDATED,
        ),
        "ilc_above": (
            "An identified plant below ILC leaves at most 95 % of what it leaves alone",
            WITH_ILC,
            ALONE,
            0.95,
            UPDATED,
        ),
        "below": (
            "A model with generic joints below a CMAC leaves at most 80 % of what the CMAC leaves alone",
            "generic joints and CMAC over phase",
            ("CMAC over phase",),
            0.8,
            UPDATED,
        ),
    }
    judged = {
        name: Finding(criteria, says=says)
        for name, (says, one, rivals, limit, setting) in stated.items()
        if (criteria := _compare(one, rivals, limit, setting, names))
    }
    return StudyFile(
        Path(__file__),
        Study(
            title="The log track of the benchmark",
            question="Which methods predict the torque of the next stroke of a robot from its log?",
            runs=lambda quick: [],
            findings=judged,
            tables={"left": lambda results: tabulate(results.computed[SCORES])},
            values=lambda results: {"findings": [*judged], **(values or {})},
        ),
    )


def _enter(gap: Gap, target: str) -> Maker:
    """Return the maker of a learner from a custom class.

    Raises:
        BadInput: the class does not exist, or has no ``fit`` or ``predict``.
    """
    method = find_class("--method", target)
    require(
        hasattr(method, "fit") and hasattr(method, "predict"),
        "--method",
        target,
        "must have fit(strokes) and predict(stroke) to take a log",
    )
    return lambda: Entered(gap.signals, method())


def choose_makers(gap: Gap, names: str | None, targets: Sequence[str], identified: bool) -> dict[str, Maker]:
    """Return the makers of the chosen methods that the log allows, and of custom classes, by name.

    ``identified`` includes the identified plants.

    Raises:
        BadInput: as :func:`pipelines.benchmark.entrants.choose`, or the log does not allow a method named.
    """
    chosen: dict[str, Maker | None] = choose(names, targets, dict.fromkeys(METHODS), partial(_enter, gap))
    add_makers(gap)
    if identified and gap.replays:
        gap.makers |= list_identified(gap.problem, choose_level(gap.problem)[0], gap.makers["model"])
    makers = {name: make or gap.makers[name] for name, make in chosen.items() if make or name in gap.makers}
    allowed = ", ".join(slug(name) for name in METHODS if name in gap.makers)
    require(not names or len(makers) == len(chosen), "--methods", names, f"this log allows {allowed}")
    return makers


def run(arguments: Arguments, options: Options) -> Path:
    """Score every method on the log, write scores, statements and page, and return the path of the page."""
    simulated = str(arguments.log) == SIMULATED
    require(
        simulated or arguments.robot is not None,
        "--robot",
        None,
        "is missing: an option of conf/machine, or an MJCF or URDF file",
    )
    log, machine = (
        (simulate_log(), read_machine(str(MODEL), NAMES)) if simulated else read_given(arguments, [arguments.log])
    )
    gap = measure(log, machine)
    folder = options.choose_folder(f"{NAME}-{SIMULATED}" if simulated else NAME)
    makers = choose_makers(gap, arguments.methods, arguments.method, not options.quick)
    trials = [(gap, name, make, setting) for name, make in makers.items() for setting in SETTINGS]
    rows = [row for _, row in map_runs(try_method, trials, Here(), "predicting strokes", len(trials))]
    about = {
        "log": log.path.name,
        "robot": Path(machine.name).name,
        "strokes": gap.signals.count,
        "scored": list_scored(gap.signals),
        "fastest": gap.signals.fastest,
        "version": VERSION,
        "causes": [f"{row['method']}, {row['setting']}: {row['cause']}" for row in rows if row["cause"]],
    }
    results = Results([], {SCORES: pd.DataFrame(rows)})
    root = Path(__file__).parents[2]
    sources = [*(root / "cmacexp" / "addons" / "gap").glob("*.py"), *Path(__file__).parent.glob("*log*.py")]
    provenance = {
        **make_provenance(digest_files(sources, root), results, [], seeds=1),
        "runs": len(rows),
        "log": "" if simulated else hashlib.sha256(log.path.read_bytes()).hexdigest(),
    }
    write_results(make_study([*makers], about), results, folder, options.quick, provenance, {})
    return folder / HTML
