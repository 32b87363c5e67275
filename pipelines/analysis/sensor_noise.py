"""Noisy sensors: at which level noise of each signal is felt, on one leg and on four."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Drawing, Section, Table, Text
from pipelines.analysis import figures_sensors as figures
from pipelines.analysis.sensor_failures import GAINS, THIN, WALK, gain
from pipelines.shared.runs import Runs
from pipelines.shared.stats import Spread, spread
from pipelines.shared.study import Jobs

if TYPE_CHECKING:
    import pandas as pd

LEG_CYCLES, WALK_CYCLES = 10, 15
FIFTH = 5
"""Cycle of one leg in which the paper measures."""
LEG_SEEDS, WALK_SEEDS = 8, 5
WALK_GAIN = 1e-3
FELT = 1.5
"""A level is felt where an error is at least this multiple of that without noise."""


class Noise(NamedTuple):
    """White noise on one signal."""

    signal: str
    field: str
    unit: str
    leg: tuple[float, ...]
    """Levels for one leg."""
    walk: tuple[float, ...]
    """Levels for the quadruped."""


NOISES = (
    Noise("force", "noise_relative", "of the force", (0.05, 0.1, 0.2, 0.4), (0.05, 0.1, 0.2, 0.4)),
    Noise("position", "noise", "rad", (1e-4, 3e-4, 1e-3, 3e-3), (1e-5, 3e-5, 1e-4, 3e-4)),
    Noise("velocity", "noise", "rad/s", (0.003, 0.01, 0.03, 0.1), (0.003, 0.01, 0.03, 0.1)),
    Noise("height", "noise", "m", (), (1e-6, 1e-5, 1e-4, 1e-3)),
    Noise("tilt", "noise", "rad", (), (1e-6, 1e-5, 1e-4, 1e-3)),
)


def _setting(noise: Noise, level: float) -> list[str]:
    return ["sensors=real", f"sensors.{noise.signal}.{noise.field}={level}"]


def jobs(quick: bool) -> Jobs:
    """Every level of every signal, for some seeds; 20 % on the force at every gain."""
    leg = ["scenario=one_leg", f"cycles={LEG_CYCLES}", THIN]
    walk = [*WALK, f"cycles={WALK_CYCLES}", THIN]
    runs: dict[str, list[str]] = {}
    for seed in range(2 if quick else LEG_SEEDS):
        runs[f"leg sound 0 {seed}"] = [*leg, f"seed={seed}"]
        for noise in NOISES[:1] if quick else NOISES:
            for level in noise.leg[2:3] if quick else noise.leg:
                runs[f"leg {noise.signal} {level:g} {seed}"] = [*leg, f"seed={seed}", *_setting(noise, level)]
    for seed in range(2 if quick else WALK_SEEDS):
        base = [*walk, *gain(WALK_GAIN), f"seed={seed}"]
        runs[f"walk sound 0 {seed}"] = base
        for noise in NOISES[:1] if quick else NOISES:
            for level in noise.walk[2:3] if quick else noise.walk:
                runs[f"walk {noise.signal} {level:g} {seed}"] = [*base, *_setting(noise, level)]
        for value in () if quick else GAINS:
            for level in (0.0, 0.2):
                setting = [*walk, *gain(value), f"seed={seed}", *_setting(NOISES[0], level)]
                runs[f"gain {value:g} {level:g} {seed}"] = setting
    return runs


def _leg(run: StoredRun) -> dict[str, float]:
    """Of one leg in the fifth cycle: mm and N m."""
    rows = run.metrics[run.metrics["cycle"] == FIFTH]
    if run.status != "completed" or rows.empty:
        return {"y": float("nan"), "feedback": float("nan"), "force": float("nan")}
    row = rows.iloc[0]
    return {"y": 1e3 * row["transfer_rmse_y"], "feedback": row["feedback_rms"], "force": row["force_rmse"]}


def _walk(run: StoredRun) -> dict[str, float]:
    """Of a quadruped over its last three cycles: N, N m and mrad."""
    if run.status != "completed":
        return {"force": float("nan"), "feedback": float("nan"), "tilt": float("nan")}
    rows = run.metrics[run.metrics["cycle"] > WALK_CYCLES - 3]
    tilt = run.body_metrics["tilt_max"].iloc[-3:].max()
    pooled = {name: float((rows[name] ** 2).mean() ** 0.5) for name in ("force_rmse_cycle", "feedback_rms")}
    return {"force": pooled["force_rmse_cycle"], "feedback": pooled["feedback_rms"], "tilt": 1e3 * float(tilt)}


def measured(runs: Runs, kind: str) -> "pd.DataFrame":
    """One row per signal and level of ``leg``, ``walk`` or ``gain``: spreads over the seeds, how many ended well."""
    import pandas as pd

    found: dict[tuple[str, float], list[dict[str, float]]] = {}
    for name, run in runs.items():
        if name.startswith(f"{kind} "):
            _, signal, level, _ = name.split()
            found.setdefault((signal, float(level)), []).append((_leg if kind == "leg" else _walk)(run))
    rows = []
    for (signal, level), values in found.items():
        good = [v for v in values if np.isfinite(v["feedback"])]
        spreads = {key: spread([v[key] for v in good]) for key in values[0]}
        rows.append({"signal": signal, "level": level, "well": len(good), "of": len(values), **spreads})
    return pd.DataFrame(rows)


def felt_from(rows: "pd.DataFrame", signal: str, key: str) -> float:
    """The least level at which ``key`` is FELT times that without noise, or a run fails; else infinite."""
    sound = rows[rows["signal"] == "sound"].iloc[0][key].mean
    own = rows[rows["signal"] == signal].sort_values("level")
    for _, row in own.iterrows():
        if row["well"] < row["of"] or row[key].mean >= FELT * sound:
            return float(row["level"])
    return float("inf")


def _table(rows: "pd.DataFrame", keys: dict[str, str], caption: str) -> Table:
    units = {noise.signal: noise.unit for noise in NOISES}
    body = [
        [
            f"{row['signal']} {row['level']:g} {units[row['signal']]}" if row["signal"] in units else "no noise",
            f"{row['well']} of {row['of']}",
            *(str(row[key]) for key in keys),
        ]
        for _, row in rows.iterrows()
    ]
    return Table(["noise", "end well", *keys.values()], body, caption)


def _levels(rows: "pd.DataFrame", keys: tuple[str, ...]) -> str:
    summaries = []
    for noise in NOISES:
        if noise.signal not in set(rows["signal"]):
            continue
        levels = {key: felt_from(rows, noise.signal, key) for key in keys}
        least = min(levels.values())
        key = min(levels, key=lambda name: levels[name])
        most = rows[rows["signal"] == noise.signal]["level"].max()
        words = {"y": "transfer error", "force": "force error", "feedback": "feedback torque", "tilt": "tilt"}
        summaries.append(
            f"{noise.signal} from {least:g} {noise.unit} (first the {words[key]})"
            if np.isfinite(least)
            else f"{noise.signal} not up to {most:g} {noise.unit}"
        )
    return "; ".join(summaries)


def _force_text(rows: "pd.DataFrame") -> str:
    """What 20 % on the force does to one leg."""
    noisy = rows[(rows["signal"] == "force") & (rows["level"] == 0.2)].iloc[0]
    sound = rows[rows["signal"] == "sound"].iloc[0]
    more: Spread = noisy["feedback"]
    return (
        f"With 20 % on the force one leg still learns: y {noisy['y']} mm in cycle {FIFTH} (without noise "
        f"{sound['y']} mm), while its feedback torque is {more.mean / sound['feedback'].mean:.1f} times as large."
    )


def _gain_section(rows: "pd.DataFrame") -> list[Table | Text]:
    """20 % on the force of a quadruped at every gain."""
    body, felt = [], []
    for value in sorted({float(signal) for signal in rows["signal"]}):
        own = rows[rows["signal"] == f"{value:g}"]
        still, noisy = (own[own["level"] == level].iloc[0] for level in (0.0, 0.2))
        cells = [str(row[key]) for key in ("force", "feedback", "tilt") for row in (still, noisy)]
        body.append([f"{value:g}", f"{noisy['well']} of {noisy['of']}", *cells])
        if noisy["well"] < noisy["of"] or noisy["feedback"].mean >= FELT * still["feedback"].mean:
            felt.append(value)
    columns = [
        "gain",
        "end well",
        "force, N",
        "with noise",
        "feedback, N m",
        "with noise",
        "tilt, mrad",
        "with noise",
    ]
    levels = f"from a gain of {min(felt):g} on" if felt else "at none of these gains"
    return [
        Table(columns, body, "Quadruped with 20 % noise on all forces, last three cycles, mean over seeds"),
        Text(
            f"Noise of 20 % on the force is felt in the feedback torque of a quadruped {levels}. Advice: raise P_fn "
            "and V_fn only as far as the force sensors are good, and where they are poor stay at 1e-3 or below."
        ),
    ]


def sections(runs: Runs) -> list[Section]:
    """Noise of one leg and of a quadruped."""
    leg, walk = measured(runs, "leg"), measured(runs, "walk")
    intervals = "mean and 95 % confidence interval over seeds"
    keys = {"y": "transfer y, mm", "force": "force rmse, N", "feedback": "feedback torque, N m"}
    body = {"force": "force rmse, N", "feedback": "feedback torque, N m", "tilt": "tilt, mrad"}
    one = [
        _table(leg, keys, f"One leg in cycle {FIFTH}, {intervals}"),
        Drawing(
            "noise_leg",
            figures.noise(leg, {"y": "transfer y, mm", "feedback": "feedback torque, N m"}),
            f"One leg in cycle {FIFTH} over the level of white noise; grey: without noise.",
        ),
        Text(
            f"{_force_text(leg)} Felt (a value {FELT} times as large as without noise) are: "
            f"{_levels(leg, ('y', 'feedback'))}. Advice: look after the force sensor first, whose noise comes "
            "through multiplied by K_ap P_fn, here 10 N for each N; noise goes into the torque, which wears motors, "
            "and hardly into errors, since learning averages it."
        ),
    ]
    four = [
        _table(walk, body, f"Quadruped at a gain of {WALK_GAIN:g}, last three of {WALK_CYCLES} cycles, {intervals}"),
        Drawing(
            "noise_walk",
            figures.noise(walk, {"force": "force rmse, N", "feedback": "feedback torque, N m"}),
            "A quadruped over the level of white noise; grey: without noise.",
        ),
        Text(
            f"Felt are: {_levels(walk, ('force', 'feedback', 'tilt'))}. Advice: take sensors a few times better than "
            "these levels, and no more: below them noise shows in nothing, and even there in the torque before it "
            "shows in force or tilt."
        ),
    ]
    found = [Section("Noise on one leg", one, beyond=True), Section("Noise on four legs", four, beyond=True)]
    gains = measured(runs, "gain")
    return [*found, Section("Noisy forces and the gain", _gain_section(gains), beyond=True)] if len(gains) else found
