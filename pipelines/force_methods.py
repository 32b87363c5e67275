"""Four ways to control the force of a point mass (Lin & Song 1997, sections 2 and 3, eq. 8-15).

``python -m pipelines.force_methods`` brings a mass down on soft and on hard ground under each method, lets it go
where there is no ground, and gives it ground that is not as stiff as assumed.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from cmacexp.control.hybrid_kernels import METHODS as FORCE_METHODS
from cmacexp.data.run import Run
from cmacexp.planning.reference import Gains, compute_support_reference
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import (
    Claim,
    Criterion,
    DataFrame,
    Figure,
    Finding,
    Request,
    Results,
    Study,
    at_least,
    at_most,
    grid,
)
from cmacexp.study.curves import over_setting
from cmacexp.study.samples import quotients
from cmacexp.study.statements import Limit
from cmacexp.study.study import Values
from cmacexp.study.tables import tabulate
from cmacexp.typing import Array
from pipelines.common_results import percent

METHODS = {name: [f"force_control={name}"] for name in FORCE_METHODS}
EQUATIONS = dict(zip(METHODS, ("eq. 9", "eq. 11", "eq. 13", "eq. 15"), strict=True))
ASSUMED, STIFFER = 10.0, 1.1
"""Ground stiffness of section 5, N/m, which the references are made for; the factor of a stiffer ground, from both of
which the stiffness of the controlled mass follows."""
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""True over assumed ground stiffness."""
HEAVIER = "machine.mass=1.0"
CLEARANCE = "machine.start_clearance"
CLEARANCES = (0.05, 0.02, 0.035, 0.075, 0.1)
"""Heights of the release over known ground, m, first that of the scenario; the paper gives none."""
KNOWN, FREE, MISMATCH, SPRING = "known ground", "no ground", "ground not as assumed", "spring"
GROUNDS = {f"{stiffness:g} N/m": [f"terrain.stiffness={stiffness}"] for stiffness in (ASSUMED, 100.0)}
EXACT, WRONG = at_most(0.02), at_least(0.1)
"""Departures from the desired force, as a part of it."""
DIGITS = 6
"""Decimals of measures: what is below is rounding of the simulation."""
MOST_FORCE = 4.0
"""Drawn, N."""


def runs(quick: bool) -> list[Request]:
    """Known ground, soft and hard; no ground; ground not as stiff as assumed; other elasticities."""
    step, assumed = "scenario=force_step", f"terrain.assumed_stiffness={ASSUMED}"
    stiffness = {"terrain.stiffness": [ASSUMED * factor for factor in (FACTORS[1:4] if quick else FACTORS)]}
    elasticity = {"force_control.elasticity": (0.0, 0.1) if quick else (0.0, 0.01, 0.03, 0.1, 0.3)}
    grounds = {"terrain.stiffness": [ASSUMED, ASSUMED * STIFFER]}
    resting = METHODS | {"explicit": [*METHODS["explicit"], HEAVIER]}
    known: Values = {"ground": GROUNDS, CLEARANCE: CLEARANCES[: 2 if quick else None]}
    return [
        *grid(step, over={"method": METHODS, **known}, part=KNOWN),
        *grid(step, HEAVIER, over={"method": {"explicit": METHODS["explicit"]}, **known}, part=KNOWN),
        *grid(step, assumed, "terrain.stiffness=0.001", over={"method": METHODS}, part=FREE),
        *grid(step, assumed, over={"method": resting, **stiffness}, part=MISMATCH),
        *grid(step, assumed, "force_control=stiffness", over={**elasticity, **grounds}, part=SPRING),
    ]


def settled_force(run: Run) -> float:
    """Mean force over the second half of the run over the desired one; inf if the run ended before."""
    if run.status != "completed":
        return math.inf
    return round(float(run.metrics["force_settled"].iloc[0]) / run.config["force_control"]["desired_force"], DIGITS)


def rest_error(run: Run) -> float:
    """RMS force error over the second half of the run, of the desired force; inf if the run ended before."""
    if run.status != "completed":
        return math.inf
    ripple = float(run.metrics["force_ripple"].iloc[0]) / run.config["force_control"]["desired_force"]
    return round(math.hypot(settled_force(run) - 1.0, ripple), DIGITS)


def end_speed(run: Run) -> float:
    """Speed in the last step, m/s; inf if the run ended before."""
    return round(abs(float(run.trace["vy"].iloc[-1])), DIGITS) if run.status == "completed" else math.inf


def over_best_other(results: Results, metric: str) -> Array:
    """(clearances,): a metric of combined control over the least of others that come to rest; inf if it does not."""
    return np.concatenate([_over_best_other(own, metric) for own in results.by(CLEARANCE).values()])


def _over_best_other(results: Results, metric: str) -> Array:
    rests = np.isfinite(results.at(1, metric)) & (results.measure("rest_error") <= EXACT.high)
    values = np.where(rests, results.at(1, metric), np.inf)
    combined = np.array([row.settings["method"] == "combined" for row in results.rows])
    return quotients(values[combined], float(values[~combined].min()))


def predicted_force(config: dict[str, Any]) -> float:
    """Settled over desired force on ground that is not as stiff as assumed.

    The reference of eq. 9 and 13 is what the force needs on the assumed ground; the true ground answers with as much
    force as that reference would be made for there. Damping and explicit control do not know of the ground.
    """
    controller, control, ground = config["controller"], config["force_control"], config["terrain"]

    def depression(stiffness: float) -> float:
        """That is fed per newton of desired force, m/N; NaN for a method without one."""
        gains = Gains(
            controller["position_gain"], controller["velocity_gain"], control["force_gain"], control["elasticity"],
            control["admittance"], stiffness,
        )  # fmt: skip
        return compute_support_reference(control["method"], gains, True).depression

    ratio = depression(ground["assumed_stiffness"]) / depression(ground["stiffness"])
    return 1.0 if math.isnan(ratio) else ratio


def apparent_stiffness(softer: DataFrame, stiffer: DataFrame) -> float:
    """Stiffness of a controlled mass as the ground feels it, N/m: from where it rests on two grounds."""
    force, depth = (stiffer[name].iloc[-1] - softer[name].iloc[-1] for name in ("force", "y"))
    return float(-force / depth)


def _predicted_forces(results: Results) -> Array:
    return np.array([predicted_force(run.config) for run in results.runs])


def _springs(results: Results) -> tuple[Array, Array]:
    """Apparent stiffness under stiffness control for each elasticity, rising, N/m: measured, and after eq. 8."""
    groups = dict(sorted(results.by("force_control.elasticity").items()))
    traces = [[run.trace for run in group.runs] for group in groups.values()]  # on two grounds
    gain = float(results.value("controller.position_gain"))
    measured = np.array([round(apparent_stiffness(softer, stiffer), DIGITS) for softer, stiffer in traces])
    return measured, np.array([gain / (1.0 + gain * float(elasticity)) for elasticity in groups])


def _softening(results: Results) -> Array:
    measured, _ = _springs(results)
    return measured[1:] / measured[:-1]


def _as_printed(results: Results) -> Results:
    """The runs with the mass of the scenario."""
    return results.select({"machine.mass": min(results.values("machine.mass"))})


def _rest(method: str, ground: str, mass: float | None = None) -> Criterion:
    def sample(results: Results) -> Array:
        own = results.select({"machine.mass": mass}) if mass else _as_printed(results)
        return own.measure("rest_error")

    quantity = "RMS force error over the second half of the run, over the desired force"
    of = {"part": KNOWN, "method": method, "ground": ground}
    return percent(quantity, sample, EXACT, WRONG, of, f"{ground}, {mass:g} kg" if mass else ground)


def _best(metric: str, name: str, ground: str) -> Criterion:
    return Criterion(
        f"{name} of combined control over the least of the other methods that come to rest",
        lambda results: over_best_other(_as_printed(results), metric),
        at_most(1.0),
        at_least(1.0),
        of={"part": KNOWN, "ground": ground},
        case=ground,
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
            Criterion(
                "apparent stiffness over that at the next smaller elasticity",
                _softening,
                at_most(0.9),
                at_least(1.0),
                of={"part": SPRING},
            ),
            percent(
                "difference of the apparent stiffness from eq. 8",
                lambda results: abs(np.divide(*_springs(results)) - 1.0),
                EXACT,
                WRONG,
                of={"part": SPRING},
            ),
        ],
    ),
}


def _speed(method: str, limit: Limit) -> Criterion:
    of = {"part": FREE, "method": method}
    quantity = "speed at the end without ground"
    return Criterion(
        quantity, lambda results: results.measure("end_speed"), limit, unit="m/s", of=of, case=method,
        infinite="the run diverged",
    )  # fmt: skip


def _departure(method: str, limit: Limit) -> Criterion:
    of = {"part": MISMATCH, "method": method, "terrain.stiffness": 2.0 * ASSUMED}
    quantity = "error of the mean force on ground twice as stiff as assumed"
    return percent(quantity, lambda r: abs(r.measure("settled_force") - 1.0), limit, None, of, method)


def _prediction(factor: float) -> Criterion:
    def largest(results: Results) -> Array:
        return abs(results.measure("settled_force") / _predicted_forces(results) - 1.0).max(keepdims=True)

    of = {"part": MISMATCH, "terrain.stiffness": factor * ASSUMED}
    quantity = "difference of the mean force from eq. 8 to 15, largest of all methods"
    return percent(quantity, largest, EXACT, None, of, f"{factor:g} times the assumed stiffness")


STILL, MOVES = at_most(0.01), at_least(0.05)
"""Speeds, m/s."""
FINDINGS = {
    "approach": Finding(
        [_speed("stiffness", STILL), _speed("combined", STILL), _speed("damping", MOVES), _speed("explicit", MOVES)],
        says="Without ground the methods with a position term come to rest, damping and explicit "
        "control do not: where one law has to serve approach and contact, take stiffness or "
        "combined control",
    ),
    "mismatch": Finding(
        [
            *(_departure(method, WRONG) for method in ("stiffness", "combined")),
            *(_departure(method, EXACT) for method in ("damping", "explicit")),
        ],
        says="Methods that press through a position need the stiffness of the ground, damping and "
        "explicit control do not",
    ),
    "prediction": Finding(
        [_prediction(factor) for factor in (FACTORS[0], FACTORS[-1])],
        says=f"Equations 8 to 15 predict every method's mean force on ground {FACTORS[0]:g} and "
        f"{FACTORS[-1]:g} times as stiff as assumed",
    ),
}


def draw_forces(results: Results) -> Figure:
    """Contact force after the release, a panel for each method."""
    panels = []
    for method, own in results.by("method").items():
        series = []
        for ground, group in own.by("ground").items():
            trace = group.run.trace
            shown = trace[(trace["time"] <= 2.0) & (trace["force"] <= MOST_FORCE)]
            series.append(Series(f"ground {ground}", shown["time"].to_numpy(), shown["force"].to_numpy()))
        desired = [own.value("force_control.desired_force")]
        panels.append(Panel(method, "time since the release, s", "force, N", series, y_limits=desired))
    return draw(panels, height=2.0)


def draw_mismatch(results: Results) -> Figure:
    """Settled over desired force against true over assumed stiffness, measured and predicted."""
    samples = {"measured": lambda r: r.measure("settled_force"), "eq. 8 to 15": _predicted_forces}
    panels = []
    for title, sample in samples.items():
        panel = over_setting(results, "terrain.stiffness", "settled over desired force", sample, "method", log="x")
        panels.append(replace(panel, title=title, x="true stiffness, N/m", x_limits=[ASSUMED]))
    return draw(panels)


def table(results: Results) -> DataFrame:
    """Every method on known ground."""

    def shown(name: str, factor: float = 1.0) -> Any:
        return lambda own: round(factor * own.measure(name)[0], DIGITS)

    columns = {
        "settled / desired": shown("settled_force"),
        "ripple, N": shown("force_ripple"),
        "overshoot, %": shown("force_overshoot", 100.0),
        "2 % settling, s": shown("force_settling_time"),
        "ITAE, N s²": shown("force_itae"),
        "ends": lambda own: own.rows[0].run.outcome.status,
    }
    return tabulate(results, {"ground": "ground", "method": "method", "machine.mass": "mass, kg"}, columns)


def values(results: Results) -> dict[str, Any]:
    """Settings of the runs."""
    known = _as_printed(results.select(part=KNOWN))
    return {
        "mass": known.value("machine.mass"), "clearance": 1e3 * CLEARANCES[0],
        "lowest": 1e3 * min(known.values(CLEARANCE)), "highest": 1e3 * max(known.values(CLEARANCE)),
        "assumed": ASSUMED, "desired": known.value("force_control.desired_force"), "most_force": MOST_FORCE,
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
        "forces": lambda r: draw_forces(_as_printed(r.select({CLEARANCE: CLEARANCES[0]}, part=KNOWN))),
        "mismatch": lambda r: draw_mismatch(r.select(part=MISMATCH)),
    },
    tables={"methods": lambda r: table(r.select({CLEARANCE: CLEARANCES[0]}, part=KNOWN))},
    values=values,
)
