"""The paper's conclusions as numbers with limits, and which of them a variant changes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any

from cmacexp.data.stored_run import StoredRun
from pipelines.analysis.measured import per_cycle

if TYPE_CHECKING:
    import pandas as pd

LEARNT = 0.25
"""Errors below this fraction of those of cycle 1 count as small; the paper's "virtually eliminated" is stricter."""
FORCE_ERROR = 5.0
"""Steady-state force error in percent, "less than 5%"."""
MAJOR = 0.5
"""Share of the torque above which the CMAC gives the major part."""
ALONE, ALONE_WITHIN = 0.9, 0.1
"""Force that settles under feedback alone, N: "approximately 0.9 N"."""
BETTER = 1.0
"""Ratio of a method's overshoot or settling time to another's below which it is the better one."""
CYCLE = 5
"""Cycle in which the paper shows one leg."""


@dataclass(frozen=True)
class Conclusion:
    """A number, and the limits between which the paper's conclusion from it holds."""

    name: str
    """What it says, in short."""
    what: str
    """What is measured."""
    axis: str
    """When, and in which unit."""
    measure: Callable[[Any], float]
    """Of a run, or of the runs of a variant by force control method; NaN where a run ended before."""
    least: float = -inf
    most: float = inf
    logarithmic: bool = False

    def holds(self, value: float) -> bool:
        """Whether it holds; never of NaN."""
        return self.least <= value <= self.most


def _at(run: StoredRun, cycle: int | None) -> "pd.Series | None":
    """Metrics of a cycle (None: the last one requested); None if the run did not complete it."""
    table, number = per_cycle(run), cycle or run.config["cycles"]
    if number not in table.index or (run.status != "completed" and number == table.index[-1]):
        return None
    return table.loc[number]


def value(name: str, cycle: int | None, factor: float = 1.0) -> Callable[[StoredRun], float]:
    """A metric in ``cycle``, or in the last one."""

    def measure(run: StoredRun) -> float:
        row = _at(run, cycle)
        return nan if row is None else factor * float(row[name])

    return measure


def ratio(name: str, cycle: int | None) -> Callable[[StoredRun], float]:
    """A metric in ``cycle``, or in the last one, over that of cycle 1."""

    def measure(run: StoredRun) -> float:
        return value(name, cycle)(run) / value(name, 1)(run)

    return measure


def walked(run: StoredRun) -> float:
    """Whole cycles walked, over those requested."""
    cycles = len(per_cycle(run))
    return (cycles if run.status == "completed" else cycles - 1) / run.config["cycles"]


def learnt(name: str, column: str, cycle: int | None) -> Conclusion:
    """An error that is small by ``cycle``."""
    axis = f"cycle {cycle} / 1" if cycle else "last / first cycle"
    return Conclusion(f"{name} at most a quarter", name, axis, ratio(column, cycle), most=LEARNT, logarithmic=True)


def one_leg(cycle: int = CYCLE) -> tuple[Conclusion, ...]:
    """Of section 5."""
    error, alone = value("force_steady_state_error", cycle, 100.0), value("force_settled", 1)
    share = value("feedforward_share", cycle)
    least, most = ALONE - ALONE_WITHIN, ALONE + ALONE_WITHIN
    return (
        learnt("x error", "transfer_rmse_x", cycle),
        learnt("y error", "transfer_rmse_y", cycle),
        Conclusion(
            f"force error below {FORCE_ERROR:g} %",
            "force error",
            f"cycle {cycle}, %",
            error,
            -FORCE_ERROR,
            FORCE_ERROR,
        ),
        Conclusion("CMAC gives major part", "CMAC's share", f"cycle {cycle}", share, least=MAJOR),
        Conclusion(f"{ALONE:g} N under feedback", "force alone", "cycle 1, N", alone, least, most),
    )


def quadruped() -> tuple[Conclusion, ...]:
    """Of section 6."""
    share = value("feedforward_share", None)
    return (
        Conclusion("walks", "cycles walked", "of all", walked, least=1.0),
        learnt("x error", "transfer_rmse_x", None),
        learnt("y error", "transfer_rmse_y", None),
        learnt("force error", "force_rmse_three_feet", None),
        learnt("tilt", "tilt_max", None),
        Conclusion("CMAC gives major part", "CMAC's share", "last cycle", share, least=MAJOR),
    )


def against(name: str, other: str) -> Callable[[Mapping[str, StoredRun]], float]:
    """A metric of combined control over that of another method."""

    def measure(runs: Mapping[str, StoredRun]) -> float:
        ours, theirs = (float(runs[method].metrics[name].iloc[0]) for method in ("combined", other))
        return ours / theirs if theirs > 0.0 else nan

    return measure


def methods() -> tuple[Conclusion, ...]:
    """Of section 3: combined control is most suitable."""
    overshoot, settling = against("force_overshoot", "stiffness"), against("force_settling_time", "damping")
    return (
        Conclusion("less overshoot", "overshoot", "over stiffness control's", overshoot, most=BETTER),
        Conclusion("settles sooner", "settling time", "over damping control's", settling, most=BETTER),
    )


@dataclass(frozen=True)
class Outcome:
    """The result of one value of an assumption."""

    assumption: str
    taken: str
    """The value taken, in words."""
    value: str
    """The value tried, in words; empty if it is the one taken."""
    numbers: tuple[float, ...]
    """One for each conclusion."""
    later: str = ""
    """Cycle from which on the position errors are small; empty where there is nothing to learn."""

    @property
    def falls(self) -> bool:
        """Whether some number is missing because the run ended before."""
        return not all(isfinite(number) for number in self.numbers)


def changed_by(outcome: Outcome, taken: Sequence[float], conclusions: Sequence[Conclusion]) -> list[int]:
    """Indices of the conclusions that differ from those with the values taken."""
    both = zip(conclusions, outcome.numbers, taken, strict=True)
    return [k for k, (c, now, before) in enumerate(both) if c.holds(now) != c.holds(before)]


def matters(
    outcomes: Sequence[Outcome], taken: Sequence[float], conclusions: Sequence[Conclusion]
) -> tuple[Mapping[str, list[Outcome]], list[str]]:
    """Assumptions of which some value changes a conclusion, with those values; and those of which none does."""
    changing: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        if changed_by(outcome, taken, conclusions):
            changing.setdefault(outcome.assumption, []).append(outcome)
    names = dict.fromkeys(outcome.assumption for outcome in outcomes)
    return changing, [name for name in names if name not in changing]


def cycle_of(run: StoredRun, names: Sequence[str]) -> float:
    """First cycle from which on all of these are learnt, NaN if none is."""
    table = per_cycle(run)
    if run.status != "completed":
        return nan
    missed = (table[list(names)] > LEARNT * table[list(names)].loc[1]).any(axis=1)
    last = max((int(k) for k in table.index[missed]), default=0)
    return float(last + 1) if last < table.index[-1] else nan


def shown(number: float) -> str:
    """As a table shows it."""
    if not isfinite(number):
        return "-"
    return f"{number:.3f}" if abs(number) < 1.0 else f"{number:.2f}"
