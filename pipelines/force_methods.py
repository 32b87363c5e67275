"""Four ways to control the force of a point mass (Lin & Song 1997, sections 2 and 3, eq. 8-15).

``python -m pipelines.force_methods`` brings a mass down on soft and on hard ground under each method, lets it go
where there is no ground, and gives it ground that is not as stiff as assumed.
"""

from typing import TYPE_CHECKING, Any

from cmacexp.cli.study import main
from cmacexp.study import Claim, Criterion, Finding, Request, Results, Study, at_least, at_most, grid
from pipelines import force_methods_figures as figures
from pipelines.force_methods_measures import (
    DIGITS,
    METHODS,
    end_speed,
    over_best_other,
    predicted_forces,
    rest_error,
    settled_force,
    springs,
)

if TYPE_CHECKING:
    import pandas as pd

    from cmacexp.typing import Array

ASSUMED, HARD, NO_GROUND = 10.0, 100.0, 0.001
"""Ground stiffness of section 5, N/m, which the references are made for; that of hard and of no ground."""
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""True over assumed ground stiffness."""
ELASTICITIES = (0.0, 0.01, 0.03, 0.1, 0.3)
STIFFER = 1.1
"""Two grounds from which the stiffness of the controlled mass follows: as assumed, and stiffer by this factor."""
HEAVIER = "machine.mass=1.0"
EQUATIONS = dict(zip(METHODS, ("eq. 9", "eq. 11", "eq. 13", "eq. 15"), strict=True))
KNOWN, FREE, MISMATCH, SPRING = "known ground", "no ground", "ground not as assumed", "spring"
SOFT = f"{ASSUMED:g} N/m"
GROUNDS = {SOFT: [f"terrain.stiffness={ASSUMED}"], f"{HARD:g} N/m": [f"terrain.stiffness={HARD}"]}
EXACT, WRONG = at_most(0.02), at_least(0.1)
"""Departures from the desired force, as a part of it."""
STILL, MOVES = at_most(0.01), at_least(0.05)
"""Speeds, m/s."""


def runs(quick: bool) -> list[Request]:
    """Known ground, soft and hard; no ground; ground not as stiff as assumed; other elasticities."""
    methods = {name: [f"force_control={name}"] for name in METHODS}
    step, assumed = "scenario=force_step", f"terrain.assumed_stiffness={ASSUMED}"
    stiffness = {"terrain.stiffness": [ASSUMED * factor for factor in (FACTORS[1:4] if quick else FACTORS)]}
    elasticity = {"force_control.elasticity": ELASTICITIES[::3] if quick else ELASTICITIES}
    grounds = {"terrain.stiffness": [ASSUMED, ASSUMED * STIFFER]}
    resting = methods | {"explicit": [*methods["explicit"], HEAVIER]}
    return [
        *grid(step, over={"method": methods, "ground": GROUNDS}, part=KNOWN),
        *grid(step, HEAVIER, over={"method": {"explicit": methods["explicit"]}, "ground": GROUNDS}, part=KNOWN),
        *grid(step, assumed, f"terrain.stiffness={NO_GROUND}", over={"method": methods}, part=FREE),
        *grid(step, assumed, over={"method": resting, **stiffness}, part=MISMATCH),
        *grid(step, assumed, "force_control=stiffness", over={**elasticity, **grounds}, part=SPRING),
    ]


def _mass(results: Results) -> float:
    """The one of the scenario, kg."""
    return float(min(results.values("machine.mass")))


def _as_printed(results: Results) -> Results:
    """Known ground, and the mass of the scenario."""
    return results.select({"machine.mass": _mass(results)})


def _rest(method: str, ground: str, mass: float | None = None) -> Criterion:
    heavier = f", {mass:g} kg" if mass else ""
    chosen: dict[str, Any] = {"part": KNOWN, "method": method, "ground": ground}

    def sample(results: Results) -> "Array":
        own = results.select({"machine.mass": mass}) if mass else _as_printed(results)
        return own.measure("rest_error")

    quantity = f"RMS force error over the second half of the run over the desired force, {ground}{heavier}"
    return Criterion(quantity, sample, EXACT, WRONG, "%", 100.0, chosen)


def _best(metric: str, name: str, ground: str) -> Criterion:
    return Criterion(
        f"{name} of combined control over the least of the other methods that come to rest, {ground}",
        lambda results: over_best_other(_as_printed(results), metric, EXACT.high),
        at_most(1.0),
        at_least(1.0),
        of={"part": KNOWN, "ground": ground},
    )


CLAIMS = {
    **{
        method: Claim(
            f"With the reference of {equation} {method} control presses with the desired force in steady state",
            "section 3",
            [_rest(method, ground) for ground in GROUNDS]
            + ([_rest(method, ground, 1.0) for ground in GROUNDS] if method == "explicit" else []),
        )
        for method, equation in EQUATIONS.items()
    },
    "combined_best": Claim(
        "Combined stiffness and damping control provides the best dynamic behaviour",
        "sections 3, 7",
        [
            _best(metric, name, ground)
            for metric, name in (("force_overshoot", "overshoot"), ("force_itae", "ITAE"))
            for ground in GROUNDS
        ],
    ),
    "spring": Claim(
        "Stiffness control behaves like a spring; the smaller the elasticity, the stiffer it is",
        "section 3.1, eq. 8",
        [
            Criterion("apparent stiffness over that at the next smaller elasticity",
                      lambda r: springs(r)[0][1:] / springs(r)[0][:-1], at_most(0.9), at_least(1.0),
                      of={"part": SPRING}),
            Criterion("departure of the apparent stiffness from eq. 8",
                      lambda r: abs(springs(r)[0] / springs(r)[1] - 1.0), EXACT, WRONG, "%", 100.0, {"part": SPRING}),
        ],
    ),
}  # fmt: skip


def _mean_error(results: Results) -> "Array":
    """(runs,): departure of the settled from the desired force, as a part of it."""
    return abs(results.measure("settled_force") - 1.0)


FINDINGS = {
    "approach": Finding(
        [
            Criterion(f"speed at the end without ground, {method}", lambda r: r.measure("end_speed"), limit,
                      unit="m/s", of={"part": FREE, "method": method})
            for method, limit in (("stiffness", STILL), ("combined", STILL), ("damping", MOVES), ("explicit", MOVES))
        ],
        yes="Without ground the methods with a position term come to rest (speed at the end {values[0]} and "
        "{values[1]}), damping and explicit control do not ({values[2]} and {values[3]}): where one law has to "
        "serve approach and contact, take stiffness or combined control.",
        no="Without ground a position term does not decide which methods come to rest: the speed at the end "
        "is {values[0]} (stiffness), {values[1]} (combined), {values[2]} (damping) and {values[3]} (explicit).",
        unclear="The runs do not decide which methods come to rest without ground.",
    ),
    "mismatch": Finding(
        [
            Criterion(f"departure of the mean force on ground twice as stiff as assumed, {method}", _mean_error,
                      limit, None, "%", 100.0,
                      {"part": MISMATCH, "method": method, "terrain.stiffness": 2.0 * ASSUMED})
            for method, limit in (("stiffness", WRONG), ("combined", WRONG), ("damping", EXACT), ("explicit", EXACT))
        ],
        yes="Methods that press through a position need the stiffness of the ground: where it is twice as stiff as "
        "assumed, stiffness and combined control are off by {values[0]} and {values[1]} in the mean, damping and "
        "explicit control by {values[2]} and {values[3]}.",
        no="On ground twice as stiff as assumed the methods are off by {values[0]} (stiffness), {values[1]} "
        "(combined), {values[2]} (damping) and {values[3]} (explicit) in the mean: a position term does not explain "
        "the error.",
        unclear="The runs do not decide whether a position term explains the error on ground of another stiffness.",
    ),
    "prediction": Finding(
        [
            Criterion(f"departure of the mean force from eq. 8 to 15 at {factor:g} times the assumed stiffness, "
                      "largest of all methods",
                      lambda r: abs(r.measure("settled_force") / predicted_forces(r) - 1.0).max(keepdims=True), EXACT,
                      None, "%", 100.0, {"part": MISMATCH, "terrain.stiffness": factor * ASSUMED})
            for factor in (min(FACTORS), max(FACTORS))
        ],
        yes=f"Equations 8 to 15 predict every method's mean force on ground {min(FACTORS):g} and {max(FACTORS):g} "
        "times as stiff as assumed.",
        no="Equations 8 to 15 do not predict the mean force on ground of another stiffness: it departs by up to "
        "{values[0]} on softer and {values[1]} on stiffer ground.",
        unclear="The runs do not decide whether equations 8 to 15 predict the force on ground of another stiffness.",
    ),
}  # fmt: skip


COLUMNS = {
    "ground": ("ground", None), "method": ("method", None), "mass": ("mass, kg", None),
    "settled_force": ("settled / desired", 1.0), "force_ripple": ("ripple, N", 1.0),
    "force_overshoot": ("overshoot, %", 100.0), "force_settling_time": ("2 % settling, s", 1.0),
    "force_itae": ("ITAE, N s²", 1.0), "status": ("ends", None),
}  # fmt: skip
"""Of the table: title, and factor to the unit shown."""


def table(results: Results) -> "pd.DataFrame":
    """Every method on known ground."""
    import pandas as pd

    own = results.select(part=KNOWN)
    frame = own.table.assign(mass=[row.settings["machine.mass"] for row in own.rows])
    columns = {title: frame[name] if factor is None else factor * frame[name]
               for name, (title, factor) in COLUMNS.items()}  # fmt: skip
    return pd.DataFrame(columns).round(DIGITS).sort_values("ground", kind="stable")


def values(results: Results) -> dict[str, Any]:
    """Settings of the runs."""
    known = _as_printed(results.select(part=KNOWN))
    return {
        "mass": _mass(results), "clearance": 1e3 * known.value("machine.start_clearance"), "assumed": ASSUMED,
        "desired": known.value("force_control.desired_force"), "stiffer": STIFFER, "most_force": figures.MOST_FORCE,
        "most_depth": figures.MOST_DEPTH,
    }  # fmt: skip


STUDY = Study(
    title="Four methods of force control",
    question="How do stiffness, damping, combined and explicit force control press on soft, hard and no ground, and "
    "on ground that is not as stiff as assumed?",
    runs=runs,
    measures={"rest_error": rest_error, "settled_force": settled_force, "end_speed": end_speed},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "forces": lambda r: figures.draw_forces(_as_printed(r.select(part=KNOWN))),
        "free": lambda r: figures.draw_free(r.select(part=FREE)),
        "mismatch": lambda r: figures.draw_mismatch(r.select(part=MISMATCH), ASSUMED),
        "spring": lambda r: figures.draw_spring(r.select(part=SPRING)),
    },
    tables={"methods": table},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
