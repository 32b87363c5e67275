"""Robots that move: gaits, sensors, ground, loads that nobody told, and a robot that differs from its model.

``python -m pipelines.moving_robots`` (needs the extra ``robots``). Every walk starts from joints that are
disturbed by its seed, and has feedback alone in the same world beside it.
"""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.commands.study import main
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY
from cmacexp.metrics.registry import SHOWN
from cmacexp.study import (
    Criterion,
    Finding,
    Results,
    Study,
    at_least,
    at_most,
    between,
    draw,
)
from cmacexp.study.curves import over_cycles
from cmacexp.study.statements import Limit, percent
from cmacexp.study.tables import completed, ends, tabulate
from cmacexp.typing import Array
from pipelines.moving_robots_runs import (
    ALONE,
    ANEW,
    AS_MODELLED,
    CARRIED,
    CMAC,
    FAST,
    FIXED,
    GAIT,
    GAITS,
    GO2,
    GROUNDS,
    LAG,
    LATE,
    MODEL,
    NETWORKS,
    PAYLOAD,
    SLOPE,
    SOON,
    STARTS,
    TROT,
    WORLD,
    runs,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

POSITION, FORCE = "transfer_rmse", "force_rmse"


def speed(run: StoredRun) -> float:
    """Mean speed over the last cycle, over the planned one; NaN of a walk that ended before."""
    if run.status != "completed":
        return float("nan")
    body, gait = run.cycles([run.config["cycles"]], BODY), run.config["gait"]
    time, travel = body["time"].to_numpy(), body["cog_x"].to_numpy()
    planned = gait["stroke"] / (gait["duty_factor"] * gait["cycle_time"])
    return float((travel[-1] - travel[0]) / (time[-1] - time[0]) / planned)


def drift(run: StoredRun) -> float:
    """Distance of the body from its course in the last cycle, m; NaN of a walk that ended before."""
    if run.status != "completed":
        return float("nan")
    return float(np.abs(run.cycles([run.config["cycles"]], BODY)["cog_y"]).max())


def _columns() -> dict[str, Any]:
    return {
        "completed": completed,
        **ends((POSITION, FORCE), cycles=1),
        "speed over planned": lambda own: float(own.measure("speed").mean()),
        "off course, mm": lambda own: 1e3 * float(own.measure("drift").mean()),
    }


def last(results: Results, name: str) -> Array:
    """(runs,): a metric of the last planned cycle; the worst value of a run that ended before."""
    return results.end(name, cycles=1)


def over_alone(results: Results, name: str, kind: str = CMAC) -> Array:
    """(runs,): a metric of the last cycle over that of feedback alone in the same world, seed by seed."""
    learnt, alone = (last(results.select(kind=each), name) for each in (kind, ALONE))
    return np.divide(learnt, alone, out=np.full(learnt.shape, np.inf), where=np.isfinite(learnt))


def _soon(results: Results) -> Array:
    """(runs,): force error soon after a load was put on, over that without it."""
    loaded, plain = (results.select(world=world, kind=CMAC).at(SOON, FORCE) for world in (PAYLOAD, AS_MODELLED))
    return loaded / plain


def _first_cycle(results: Results) -> Array:
    """(runs,): transfer error of the first cycle with weights of another speed, over that without."""
    carried, anew = (results.select(part=part).at(1, POSITION) for part in (CARRIED, ANEW))
    return carried / anew


def _completed(results: Results) -> list[bool]:
    return results.completed


def _position(words: str, limit: float, **of: Any) -> Criterion:
    shown = SHOWN[POSITION]
    sample = partial(last, name=POSITION)
    return Criterion(words, sample, at_most(limit), unit=shown.unit, scale=shown.factor, of={"kind": CMAC} | of)


def _each(words: str, make: Any, over: Any = tuple(GROUNDS)) -> list[Criterion]:
    return [make(f"{words}, {ground} ground", ground=ground) for ground in over]


def _ratio(name: str, limit: Limit, kind: str = CMAC, **of: Any) -> Any:
    return lambda words, ground: percent(words, partial(over_alone, name=name, kind=kind), limit, ground=ground, **of)


FINDINGS = {
    "walks": Finding(
        [percent(f"walks completed, {gait}", _completed, at_least(0.9), part=GAIT, gait=gait) for gait in GAITS],
        yes="Every gait walks to the end, alone and while a CMAC learns, with perfect sensors and encoders.",
        no="Not every gait walks to the end with feedback alone and with a CMAC: see the table.",
    ),
    "trot": Finding(
        _each(
            "transfer error of the last cycle",
            lambda words, ground: _position(words, 0.7e-3, part=GAIT, gait=TROT, sensors="perfect", ground=ground),
        ),
        yes="In a trot of 0.4 m/s the feet follow their paths within 0.7 mm to the end.",
        no="In a trot of 0.4 m/s the feet do not follow their paths within 0.7 mm on both grounds.",
    ),
    "course": Finding(
        [
            *_each(
                "speed over the planned one",
                lambda words, ground: percent(
                    words,
                    lambda own: own.measure("speed"),
                    between(0.99, 1.01),
                    part=GAIT,
                    gait=TROT,
                    sensors="perfect",
                    ground=ground,
                    kind=CMAC,
                ),
            ),
            *_each(
                "largest distance from the course in the last cycle",
                lambda words, ground: Criterion(
                    words,
                    lambda own: own.measure("drift"),
                    at_most(0.1),
                    unit="mm",
                    scale=1e3,
                    of={"part": GAIT, "gait": TROT, "sensors": "perfect", "ground": ground, "kind": CMAC},
                ),
            ),
        ],
        yes="It keeps its speed and its course.",
        no="It does not keep its speed and its course on both grounds.",
    ),
    "fast": Finding(
        _each(
            "transfer error of the last cycle",
            lambda words, ground: _position(words, 1.5e-3, part=GAIT, gait=FAST, sensors="perfect", ground=ground),
        ),
        yes="At 0.8 m/s they do within 1.5 mm.",
        no="At 0.8 m/s they do not follow them within 1.5 mm on both grounds.",
    ),
    "trot_force": Finding(
        _each(
            "force error over that of feedback alone",
            _ratio(FORCE, at_most(0.8), part=GAIT, gait=TROT, sensors="perfect"),
        ),
        yes="Learning lowers the force error of the trot.",
        no="Learning does not lower the force error of the trot as far as asked on both grounds.",
    ),
    "encoders": Finding(
        [
            *_each(
                "transfer error over that of feedback alone",
                _ratio(POSITION, at_most(1.0), part=GAIT, gait=TROT, sensors="encoders"),
            ),
            *_each(
                "transfer error of the last cycle",
                lambda words, ground: _position(words, 2e-3, part=GAIT, gait=TROT, sensors="encoders", ground=ground),
            ),
        ],
        yes="With encoders the trot is learnt, too.",
        no="With encoders the trot is not learnt within these limits.",
    ),
    "late": Finding(
        _each(
            "transfer error of the last cycle",
            lambda words, ground: _position(words, 1e-3, part=WORLD, world=LATE, ground=ground),
        ),
        yes="Torques that act a sample late are learnt and stay learnt.",
        no="Torques that act a sample late are not learnt, or do not stay learnt.",
    ),
    "payload": Finding(
        [
            Criterion(
                f"force error of cycle {SOON} with the payload over that without, {ground} ground",
                _soon,
                at_most(1.3),
                of={"part": WORLD, "ground": ground},
            )
            for ground in GROUNDS
        ],
        yes="A payload that nobody told is known from the forces of the feet within a few cycles.",
        no="A payload that nobody told is not made up for within a few cycles on both grounds.",
    ),
    "slope": Finding(
        _each(
            "force error over that of feedback alone",
            _ratio(FORCE, at_most(1.0), part=WORLD, world=SLOPE),
            ["elastic"],
        ),
        yes="On a slope learning lowers the force error.",
        no="On a slope learning does not lower the force error.",
    ),
    "as_built": Finding(
        [
            *_each(
                "transfer error over that of feedback alone", _ratio(POSITION, at_most(0.02), part=WORLD, world=GO2)
            ),
            *_each("force error over that of feedback alone", _ratio(FORCE, at_most(0.3), part=WORLD, world=GO2)),
        ],
        yes="On a robot that differs from its model as a fitted Go2 does, learning leaves little of either error.",
        no="On a robot that differs from its model as a fitted Go2 does, learning leaves more of an error.",
    ),
    "by_model": Finding(
        [
            *_each(
                "transfer error over that of feedback alone",
                _ratio(POSITION, at_least(0.2), MODEL, part=WORLD, world=GO2),
            ),
            *_each(
                "force error over that of feedback alone", _ratio(FORCE, at_least(0.2), MODEL, part=WORLD, world=GO2)
            ),
        ],
        yes="Its maker's model leaves much of both.",
        no="Its maker's model does not leave much of both on both grounds.",
    ),
    "fixed": Finding(
        _each("force error over that of feedback alone", _ratio(FORCE, at_least(0.5), FIXED, part=WORLD, world=GO2)),
        yes="Without the load that the feet show, learning leaves most of the force error.",
        no="Without the load that the feet show, learning does not leave most of the force error on both grounds.",
    ),
    **{
        f"carries_{network}_{start}": Finding(
            [
                percent(
                    f"transfer error of the first cycle over that of learning anew, {ground} ground",
                    _first_cycle,
                    at_most(0.5),
                    part=[ANEW, CARRIED],
                    network=network,
                    ground=ground,
                    start=start,
                )
                for ground in GROUNDS
            ],
            yes=f"Addressed by {network}, what was learnt carries over to feet that start {start}.",
            no=f"Addressed by {network}, what was learnt does not carry over to feet that start {start}.",
        )
        for network in NETWORKS
        for start in STARTS
    },
    "lag": Finding(
        _each(
            "transfer error of the last cycle",
            lambda words, ground: _position(words, 0.5e-3, part=WORLD, world=LAG, ground=ground),
        ),
        yes="With the lag of its drives, too, the feet follow their paths to the end.",
        no="With the lag of its drives the feet do not follow their paths within the limit to the end.",
    ),
}


def table_gaits(results: Results) -> "pd.DataFrame":
    """Errors of the last cycle of every gait."""
    columns = {"gait": "gait", "ground": "ground", "sensors": "sensors", "kind": "feedforward"}
    return tabulate(results.select(part=GAIT), columns, _columns())


def table_worlds(results: Results) -> "pd.DataFrame":
    """Errors of the last cycle in every world."""
    columns = {"world": "world", "ground": "ground", "kind": "feedforward"}
    return tabulate(results.select(part=WORLD), columns, _columns())


def draw_worlds(results: Results) -> "Figure":
    """Both errors of the Go2 as built over the cycles."""
    own = results.select(part=WORLD, world=GO2, ground="elastic")
    return draw([over_cycles(own, name, "kind", log="y") for name in (POSITION, FORCE)])


def values(results: Results) -> dict[str, Any]:
    """Counts and settings that the page names."""
    learning = results.select(kind=CMAC)
    built = results.select(part=WORLD, world=GO2, kind=CMAC).run.config["plant"]
    return {"built": built, "cycles": sorted(learning.values("cycles")), "seeds": len(learning.values("seed"))}


STUDY = Study(
    title="Robots that move",
    question="What does learned feedforward gain in gaits that no static equilibrium holds, with loads that nobody "
    "told, and on a robot that differs from its model?",
    runs=runs,
    measures={"speed": speed, "drift": drift},
    findings=FINDINGS,
    figures={"worlds": draw_worlds},
    tables={"gaits": table_gaits, "worlds": table_worlds},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
