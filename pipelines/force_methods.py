"""Four ways to control the force of a point mass (Lin & Song 1997, sections 2 and 3, eq. 8-15).

``python -m pipelines.force_methods`` brings a mass down on soft and on hard ground under each method, lets it go
where there is no ground, and gives it ground that is not as stiff as assumed. What it claims: each method presses
with the desired force on the ground that it was designed for; combined control does it best; stiffness and combined
control press wrongly where the ground differs from the assumed one.
"""

from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import pandas as pd

from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.step import step_info
from cmacexp.report.page import Claim, Drawing, Link, Section, Table, Text
from pipelines.analysis import figures_force as figures
from pipelines.analysis.stiffness_mismatch import METHODS, apparent_stiffness, predicted_force
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

ASSUMED = 10.0
"""Ground stiffness of section 5, N/m, which the references are made for."""
HARD, NO_GROUND = 100.0, 0.001
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""True over assumed ground stiffness."""
ELASTICITIES = (0.0, 0.01, 0.03, 0.1, 0.3)
STIFFER = 1.1
"""Two grounds from which the stiffness of the controlled mass follows: as assumed, and stiffer by this factor."""
HEAVIER = "machine.mass=1.0"
"""Mass with which explicit force control comes to rest, kg."""
EXACT, STEADY = 0.01, 0.02
"""Largest relative error of a settled force, and largest ripple of a force at rest."""


def _job(method: str, *more: str) -> list[str]:
    return ["scenario=force_step", f"force_control={method}", *more]


def jobs(quick: bool) -> Jobs:
    """Soft, hard and no ground for every method; wrongly assumed ground; other elasticities."""
    runs = {f"soft {m}": _job(m) for m in METHODS}
    runs["soft explicit, 1 kg"] = _job("explicit", HEAVIER)
    runs |= {f"hard {m}": _job(m, f"terrain.stiffness={HARD}") for m in METHODS}
    assumed = f"terrain.assumed_stiffness={ASSUMED}"
    runs |= {f"free {m}": _job(m, f"terrain.stiffness={NO_GROUND}", assumed) for m in METHODS}
    for factor in (0.5, 1.0, 2.0) if quick else FACTORS:
        for method in METHODS:
            mass = [HEAVIER] if method == "explicit" else []
            runs[f"ground x {factor} {method}"] = _job(
                method, f"terrain.stiffness={ASSUMED * factor}", assumed, *mass
            )
    for elasticity in ELASTICITIES[::3] if quick else ELASTICITIES:
        for factor in (1.0, STIFFER):
            more = (f"terrain.stiffness={ASSUMED * factor}", assumed, f"force_control.elasticity={elasticity}")
            runs[f"elasticity {elasticity} x {factor}"] = _job("stiffness", *more)
    return runs


def measures(runs: Runs, names: Sequence[str]) -> pd.DataFrame:
    """The metrics of runs of one cycle, one row each, with their status."""
    rows = [{**runs[name].metrics.iloc[0], "status": runs[name].status} for name in names]
    return pd.DataFrame(rows, index=list(names))


def settles(row: pd.Series, desired: float) -> bool:
    """Whether a run came to rest at the desired force, N."""
    error = abs(row["force_settled"] / desired - 1.0)
    return row["status"] == "completed" and error <= EXACT and row["force_ripple"] <= STEADY * desired


def method_claim(method: str, equations: str, rows: pd.DataFrame, desired: float, links: Sequence[Link]) -> Claim:
    """Whether a method presses with the desired force on the ground that its reference is made for."""
    good = [settles(row, desired) for _, row in rows.iterrows()]
    verdict = "reproduced" if all(good) else "reproduced in part" if any(good) else "not reproduced"
    said = "; ".join(
        f"{name}: {row['force_settled']:.3f} N" + ("" if ok else f" in the mean, ripple {row['force_ripple']:.2f} N")
        for (name, row), ok in zip(rows.iterrows(), good, strict=True)
    )
    claim = f"with the reference of {equations} {method} control presses with the desired force in steady state"
    return Claim(claim, "section 3", f"desired {desired:g} N; {said}", verdict, links)


def best_claim(soft: pd.DataFrame, desired: float, links: Sequence[Link]) -> Claim:
    """Whether combined control overshoots least and errs least of the methods that come to rest."""
    resting = soft[[settles(row, desired) for _, row in soft.iterrows()]]
    best = [resting[name].idxmin() == "combined" for name in ("force_overshoot", "force_itae")]
    verdict = "reproduced" if all(best) else "reproduced in part" if any(best) else "not reproduced"
    measured = "overshoot and ITAE: " + ", ".join(
        f"{name} {row['force_overshoot']:.0%} and {row['force_itae']:.4f} N s²" for name, row in resting.iterrows()
    )
    resting_not = [str(name) for name in soft.index.difference(resting.index)]
    if resting_not:
        measured += f"; {', '.join(resting_not)} does not come to rest"
    claim = "combined stiffness and damping control is the most suitable, with the best dynamic behaviour"
    return Claim(claim, "sections 3, 7", measured, verdict, links)


def elasticity_claim(stiffness: dict[float, float], links: Sequence[Link]) -> Claim:
    """Whether a smaller elasticity makes the controlled mass stiffer; ``stiffness`` in N/m by elasticity in m/N."""
    by_elasticity = [stiffness[p] for p in sorted(stiffness)]
    falls = [a > b for a, b in pairwise(by_elasticity)]
    verdict = "reproduced" if all(falls) else "reproduced in part" if any(falls) else "contradicted"
    said = ", ".join(f"{stiffness[p]:.3g} N/m at {p:g} m/N" for p in sorted(stiffness))
    claim = "stiffness control behaves like a spring; the smaller the elasticity, the stiffer it is"
    return Claim(claim, "section 3.1, eq. 8", f"apparent stiffness {said}", verdict, links)


def _desired(run: StoredRun) -> float:
    return float(run.trace["force_desired"].iloc[-1])


def _table(rows: pd.DataFrame, caption: str) -> Table:
    columns = ["method", "settles at, N", "ripple, N", "overshoot, %", "2 % settling, s", "ITAE, N s²", "ends"]
    names = ("force_settled", "force_ripple", "force_overshoot", "force_settling_time", "force_itae")
    factors, forms = (1, 1, 100, 1, 1), ("{:.3f}", "{:.3f}", "{:.0f}", "{:.2f}", "{:.4f}")
    return Table(
        columns,
        [
            [
                str(name),
                *(
                    "-" if pd.isna(row[n]) else form.format(row[n] * factor)
                    for n, factor, form in zip(names, factors, forms, strict=True)
                ),
                row["status"],
            ]
            for name, row in rows.iterrows()
        ],
        caption,
    )


def _free_text(runs: Runs) -> str:
    """What each method does where there is no ground."""
    summaries = []
    for method in ("stiffness", "combined"):
        trace = runs[f"free {method}"].trace
        info = step_info(trace["time"], trace["y"], float(trace["y_reference"].iloc[-1]))
        summaries.append(
            f"{method} control stops {1e3 * (trace['y'].iloc[-1] - trace['y'].iloc[0]):.0f} mm below the start, at "
            f"its reference (rise {info.rise_time:.2f} s, overshoot {info.overshoot:.0%}, 2 % settling "
            f"{info.settling_time:.2f} s)"
        )
    summaries.append(
        f"damping control goes on down at {runs['free damping'].trace['vy'].iloc[-1]:.2f} m/s, its reference velocity"
    )
    explicit = runs["free explicit"]
    summaries.append(
        "explicit control, which feels no force, accelerates without end "
        f"({explicit.status} after {explicit.trace['time'].iloc[-1]:.2f} s)"
    )
    return (
        "Where there is no ground, "
        + "; ".join(summaries)
        + ". Only with a position term does one law serve approach and contact."
    )


def _belief(runs: Runs) -> Drawing:
    """The settled force on ground that is not as stiff as assumed, beside what eq. 8-15 predict."""
    measured, predicted = {}, {}
    for method in METHODS:
        own = {n: run for n, run in runs.items() if n.startswith("ground x") and n.endswith(method)}
        desired = _desired(next(iter(own.values())))
        rows = measures(runs, list(own))
        factors = [run.config["terrain"]["stiffness"] / ASSUMED for run in own.values()]
        force = rows["force_settled"].to_numpy() / desired
        steady = (rows["force_ripple"] <= STEADY * desired).to_numpy()
        measured[method] = (factors, force, steady)
        predicted[method] = partial(predicted_force, method, next(iter(own.values())).config, ASSUMED)
    wrong = {m: dict(zip(*measured[m][:2], strict=True))[2.0] for m in METHODS}
    settled = ", ".join(f"{m} at {wrong[m]:.2f} F_d" for m in METHODS)
    return Drawing(
        "wrong_ground_stiffness",
        figures.wrong_stiffness(measured, predicted),
        f"On ground twice as stiff as assumed each method settles: {settled}. Lines: steady state of eq. 8 to 15; "
        "hollow: the mean of a force that does not come to rest. A force that is reached through a position inherits "
        "the error of the map.",
    )


def _elasticities(runs: Runs) -> tuple[dict[float, float], list[str], Drawing]:
    names = [name for name in runs if name.startswith("elasticity") and name.endswith(" x 1.0")]
    found = {
        runs[name].config["force_control"]["elasticity"]: apparent_stiffness(
            runs[name].trace, runs[name.replace(" x 1.0", f" x {STIFFER}")].trace
        )
        for name in names
    }
    gain = runs[names[0]].config["controller"]["position_gain"]
    drawing = Drawing(
        "elasticity",
        figures.apparent_stiffness(found, gain),
        "Stiffness control as a spring: force over depression between two grounds, as measured (dots), "
        "and eq. 8 (line).",
    )
    return found, names, drawing


def summarise(runs: Runs) -> list[Section]:
    """The comparison of the methods, and the effect of a wrongly assumed ground."""
    desired = _desired(runs["soft combined"])
    soft, hard = (
        measures(runs, [n for n in runs if n.startswith(kind)]).rename(index=lambda n: n.split(" ", 1)[1])
        for kind in ("soft", "hard")
    )
    claims = []
    for method, equations in zip(METHODS, ("eq. 9", "eq. 11", "eq. 13", "eq. 15"), strict=True):
        rows = soft[soft.index.str.startswith(method)]
        links = runs.links(*(f"soft {name}" for name in rows.index))
        claims.append(method_claim(method, equations, rows, desired, links))
    claims.append(best_claim(soft.loc[list(METHODS)], desired, runs.links(*(f"soft {m}" for m in METHODS))))
    stiffness, names, spring = _elasticities(runs)
    claims.append(elasticity_claim(stiffness, runs.links(*names)))
    comparison = [
        Text(
            "A point mass of 0.5 kg is released 50 mm above the ground and is to press with 1 N, under force control "
            "from the start; times count from there."
        ),
        _table(soft, f"Soft ground, {ASSUMED:g} N/m, as assumed"),
        Drawing(
            "force_methods",
            figures.force_methods(runs, METHODS, desired, ASSUMED, HARD),
            "Contact force after the release on soft and on hard ground, each as stiff as the controller assumes; "
            "grey: desired. A cross marks a run that diverged.",
        ),
        _table(hard, f"Hard ground, {HARD:g} N/m, as assumed"),
        Drawing(
            "free_space",
            figures.free_space(runs, METHODS),
            "Depth below the start where there is no ground, though the controller assumes some.",
        ),
        Text(_free_text(runs)),
        spring,
    ]
    return [
        Section("Force control methods", comparison, claims),
        Section("What the paper did not see: wrong ground stiffness", [_belief(runs)], beyond=True),
    ]


STUDY = Study(
    "force_methods",
    "Four methods of force control",
    "Stiffness, damping, combined and explicit force control of a point mass on soft, hard and no ground, and on "
    "ground that is not as stiff as assumed (Lin & Song 1997, section 3).",
    jobs,
    summarise,
)

if __name__ == "__main__":
    main(STUDY)
