"""Force sensors that break while the machine walks: the effect of each failure, and of fault detection."""

import random
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Drawing, Part, Section, Table, Text
from pipelines.analysis import figures_sensors as figures
from pipelines.analysis.measured import digits
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs

if TYPE_CHECKING:
    import pandas as pd

WALK = ["scenario=quadruped", "learning.lead=1", "gait.load_ramp=0.12"]
GAINS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""P_fn in m/N and V_fn in m/(N s) alike."""
FEEDFORWARDS = ("cmac", "none")
CHECKS = ("none", "force")
THIN = "record.every_nth_step=600"
CYCLES, LAST = 12, 3
"""Cycles of a run, and the last of them that are measured."""
EARLIEST, LATEST = 12.0, 18.0
"""When a sensor breaks, s."""
KINDS = {"zero": 0.0, "last": 0.0, "value": 40.0, "bias": 10.0, "noise": 20.0}
"""Kinds of faults, and their value in N."""
TOLD = {
    "zero": "stuck at 0",
    "last": "stuck at its last value",
    "value": "stuck at 40 N",
    "bias": "10 N too much",
    "noise": "white noise of 20 N",
}
LONG = 500
"""Cycles for which a sound machine is watched."""
ENOUGH = 38 / 40
"""Of the cases that must walk on."""
SHOWN = 3e-3
"""Gain of the failure that is drawn."""


class Case(NamedTuple):
    """One failure."""

    kind: str
    leg: int
    start: float
    """s."""

    @property
    def overrides(self) -> list[str]:
        """Of the config."""
        fault = f"kind={self.kind}", f"value={KINDS[self.kind]}", f"legs=[{self.leg}]", f"start={self.start}"
        return ["sensors=force_stuck", *(f"sensors.force.fault.{setting}" for setting in fault)]


def cases() -> list[Case]:
    """Forty, seeded: every kind on every leg, at two moments."""
    rng = random.Random(1997)
    return [
        Case(kind, leg, round(rng.uniform(EARLIEST, LATEST), 3))
        for kind in KINDS
        for leg in (1, 2, 3, 4)
        for _ in range(2)
    ]


def gain(value: float) -> list[str]:
    """Overrides that set both gains."""
    return [f"force_control.elasticity={value}", f"force_control.admittance={value}"]


def _name(gain: float, feedforward: str, check: str, case: Case | None) -> str:
    return f"failure {gain:g} {feedforward} {check} {'sound' if case is None else '-'.join(map(str, case))}"


def jobs(quick: bool) -> Jobs:
    """Sound machines and all failures, at all gains; a sound one watched for long; one failure step by step."""
    runs: dict[str, list[str]] = {}
    some = cases()[::8] if quick else cases()
    for value in GAINS[2:3] if quick else GAINS:
        for feedforward in FEEDFORWARDS[:1] if quick else FEEDFORWARDS:
            base = [*WALK, *gain(value), f"feedforward={feedforward}", f"cycles={CYCLES}", THIN]
            runs[_name(value, feedforward, "none", None)] = base
            for check in CHECKS:
                for case in some:
                    runs[_name(value, feedforward, check, case)] = [*base, *case.overrides, f"plausibility={check}"]
    long = [*WALK, *gain(1e-3), f"cycles={20 if quick else LONG}", "plausibility=force", THIN]
    runs["watched"] = long
    runs["watched, noisy"] = [*long, "sensors=noisy_force"]
    shown = Case("zero", 3, 12.2)
    for check in CHECKS:
        overrides = [*WALK, *gain(SHOWN), "cycles=6", *shown.overrides, f"plausibility={check}"]
        runs[f"shown {check}"] = [*overrides, "record.cycles=[4,5,6]"]
    return runs


def _rms(values: "pd.Series") -> float:
    return float((values**2).mean() ** 0.5)


def _row(
    run: StoredRun, gain: float, feedforward: str, check: str, case: Case | None
) -> dict[str, float | str | bool]:
    """What is measured of one run over its last whole cycles; tilt in mrad."""
    config, table = run.config, run.metrics
    steps = round(config["gait"]["cycle_time"] / config["sampling_period"])
    whole = run.manifest["steps"] // steps
    late = table[(table["cycle"] > whole - LAST) & (table["cycle"] <= whole)]
    own = late["leg"] == (case.leg if case else 0)
    found = [d["step"] for d in run.manifest["dropped"] if case and d["leg"] == case.leg]
    body = run.body_metrics
    tilt = body["tilt_max"][(body["cycle"] > whole - LAST) & (body["cycle"] <= whole)].max()
    return {
        "gain": gain,
        "feedforward": feedforward,
        "check": check,
        "kind": case.kind if case else "sound",
        "leg": case.leg if case else 0,
        "walks": run.status == "completed",
        "own": _rms(late.loc[own, "force_rmse_cycle"]) if case else float("nan"),
        "others": _rms(late.loc[~own, "force_rmse_cycle"]),
        "tilt": 1e3 * float(tilt),
        "delay": found[0] - round(case.start / config["sampling_period"]) if case and found else float("nan"),
        "wrongly": sum(1 for d in run.manifest["dropped"] if not case or d["leg"] != case.leg),
    }


def measured(runs: Runs) -> "pd.DataFrame":
    """One row per failure."""
    import pandas as pd

    def rows() -> Iterator[dict[str, float | str | bool]]:
        for value in GAINS:
            for feedforward in FEEDFORWARDS:
                for check in CHECKS:
                    for case in (None, *cases()):
                        name = _name(value, feedforward, check, case)
                        if name in runs:
                            yield _row(runs[name], value, feedforward, check, case)

    return pd.DataFrame(list(rows()))


def _told(rows: "pd.DataFrame") -> list[str]:
    """How many walk on, and medians of force errors and tilt of those that do."""
    on = rows[rows["walks"]]
    return [f"{len(on)} of {len(rows)}", *(digits(on[name].median()) for name in ("own", "others", "tilt"))]


def _gains_table(rows: "pd.DataFrame") -> Table:
    """Walking on, at each gain."""
    broken, table = rows[rows["kind"] != "sound"], []
    for (value, feedforward), own in broken.groupby(["gain", "feedforward"], sort=True):
        sound = rows[(rows["kind"] == "sound") & (rows["gain"] == value) & (rows["feedforward"] == feedforward)].iloc[
            0
        ]
        without, checked = own[own["check"] == "none"], own[own["check"] == "force"]
        table.append(
            [
                f"{value:g}, {'CMAC' if feedforward == 'cmac' else 'feedback alone'}",
                digits(sound["others"]) if sound["walks"] else "falls",
                *_told(without),
                *_told(checked),
                digits(float(checked["delay"].max())),
            ]
        )
    columns = ["gain, controller", "sound: force rmse, N"]
    for when in ("no check", "checked"):
        columns += [f"{when}: walk on", "that leg, N", "other legs, N", "tilt, mrad"]
    caption = (
        f"Force rmse over whole cycles and largest tilt in the last {LAST} of {CYCLES} cycles, medians over the "
        "failures that the machine survives. Last column: samples from a failure until the check dropped the sensor, "
        "at most (a cycle has 600)."
    )
    return Table([*columns, "found after, at most"], table, caption)


def _grouped_table(rows: "pd.DataFrame", by: str, title: str) -> Table:
    """The same by kind or leg, with CMAC."""
    broken = rows[(rows["kind"] != "sound") & (rows["feedforward"] == "cmac")]
    table = []
    for key, own in broken.groupby(by, sort=False):
        for value, at in own.groupby("gain"):
            without, checked = at[at["check"] == "none"], at[at["check"] == "force"]
            table.append([f"{TOLD.get(str(key), f'leg {key}')}, {value:g}", *_told(without), *_told(checked)])
    columns = [f"{by}, gain"]
    for when in ("no check", "checked"):
        columns += [f"{when}: walk on", "that leg, N", "other legs, N", "tilt, mrad"]
    return Table(columns, table, title)


def _walked(rows: "pd.DataFrame", check: str) -> dict[tuple[float, str], float]:
    """Share of the failures that are survived, by gain and feedforward, where the sound machine walks."""
    sound = rows[(rows["kind"] == "sound") & rows["walks"]]
    broken = rows[(rows["kind"] != "sound") & (rows["check"] == check)]
    return {
        (value, feedforward): float(
            broken[(broken["gain"] == value) & (broken["feedforward"] == feedforward)]["walks"].mean()
        )
        for value, feedforward in zip(sound["gain"], sound["feedforward"], strict=True)
    }


def _where(shares: Sequence[tuple[float, str]]) -> str:
    names = {"cmac": "with CMAC", "none": "with feedback alone"}
    return ", ".join(f"{value:g} {names[feedforward]}" for value, feedforward in shares) or "none"


def _advice(rows: "pd.DataFrame", watched: dict[str, int], cycles: int) -> Text:
    """What follows, in plain sentences."""
    without, checked = _walked(rows, "none"), _walked(rows, "force")
    falls = [key for key, share in without.items() if share < ENOUGH]
    held = [key for key, share in checked.items() if share >= ENOUGH]
    slow = rows[rows["check"] == "force"]["delay"].max()
    wrongly = int(rows["wrongly"].sum())
    alarms = ", ".join(f"{count} ({name})" for name, count in watched.items())
    advice = (
        f"Advice: up to gains of {max((v for v, f in without if (v, f) not in falls), default=0.0):g} a broken force "
        "sensor may be left alone"
        if not falls
        else f"Advice: fewer than {ENOUGH:.0%} of the failures are survived without a check at {_where(falls)}; "
        "switch plausibility=force on there"
    )
    return Text(
        f"With the check at least {ENOUGH:.0%} of the failures are survived at {len(held)} of the {len(checked)} "
        f"settings at which the sound machine walks. It finds a failure after at most {slow:.0f} samples, and "
        f"dropped {wrongly} sound sensors beside the broken ones. On a sound machine over {cycles} cycles it "
        f"dropped: {alarms}. {advice}."
    )


def sections(runs: Runs) -> list[Section]:
    """Failures of force sensors."""
    rows = measured(runs)
    watched = {
        "sound": len(runs["watched"].manifest["dropped"]),
        "20 % noise": len(runs["watched, noisy"].manifest["dropped"]),
    }
    cycles = int(runs["watched"].config["cycles"])
    shown = {check: runs[f"shown {check}"] for check in CHECKS}
    parts: list[Part] = [
        Text(
            "A quadruped walks (lead 1, load ramp 0.12 s); in the fifth or the sixth cycle the force sensor of one "
            "leg breaks. Forty failures, seeded: " + "; ".join(TOLD.values()) + "; on every leg, at two moments. "
            "The check (plausibility=force) compares what a sensor reads with what the ground would give at the "
            "measured depth of the foot, and once the evidence is large enough drops the terms of P_fn and V_fn of "
            "that leg, from the error and from the reference alike (eq. 24)."
        ),
        _gains_table(rows),
        Drawing(
            "failures",
            figures.failures(rows),
            "Failures survived, and the force rmse of the broken leg, over the gain of force feedback, with CMAC.",
        ),
        _grouped_table(rows, "kind", "By kind of failure, with CMAC"),
        _grouped_table(rows, "leg", "By leg, with CMAC"),
        Drawing(
            "failure",
            figures.failure(shown, 3, 12.2),
            f"The force sensor of leg 3 (left rear) sticks at 0 from 12.2 s on, at a gain of {SHOWN:g}.",
        ),
        _advice(rows, watched, cycles),
    ]
    return [Section("Force sensors that break", parts, beyond=True)]
