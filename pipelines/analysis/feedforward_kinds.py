"""The feedforwards that are compared, and what a run of one shows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cmacexp.data.stored_run import StoredRun
from pipelines.analysis.measured import digits, per_cycle
from pipelines.shared.runs import Runs

TENTH = 0.1
"""Transfer error over that of feedback alone at which learning counts as done."""


@dataclass(frozen=True)
class Kind:
    """A feedforward, and the overrides that choose it."""

    overrides: tuple[str, ...]
    seeded: bool = False
    """Whether its result depends on the seed."""
    learns: bool = True


ALONE, EXACT, CMAC, MLP, ILC, RBF = "feedback alone", "exact model", "CMAC", "MLP", "ILC", "RBF"
WRONG = {0.8: "masses 20 % too light", 1.2: "masses 20 % too heavy"}
KINDS = {
    ALONE: Kind(("feedforward=none",), learns=False),
    EXACT: Kind(("feedforward=inverse_dynamics",), learns=False),
    **{
        name: Kind(("feedforward=inverse_dynamics", f"feedforward.mass_factor={factor}"), learns=False)
        for factor, name in WRONG.items()
    },
    CMAC: Kind(("feedforward=cmac",), seeded=True),
    "CMAC of angles": Kind(("feedforward=cmac", "cmac.inputs=[angle]"), seeded=True),
    RBF: Kind(("feedforward=rbf",)),
    MLP: Kind(("feedforward=mlp",), seeded=True),
    ILC: Kind(("feedforward=ilc",)),
}
LEARNERS = [name for name, kind in KINDS.items() if kind.learns]
KEPT = [CMAC, RBF, MLP, ILC]
"""Learners whose weights are carried over to another ground or path."""


ONE_LEG, FOUR_LEGS, SMOOTH = "one leg", "four legs", "without jumps"
RATES = (50 / 256, 0.5, 1.0)
"""That of the paper, and the rate that suits iterative learning control."""
CHANGES = {
    "stroke 150 mm": ("gait.stroke=0.15",),
    "stroke 250 mm": ("gait.stroke=0.25",),
    "ground 1.5 times as stiff, known": ("terrain.stiffness=15",),
    "ground 1.5 times as stiff, unknown": ("terrain.stiffness=15", "terrain.assumed_stiffness=10"),
}
"""What becomes of the path of 200 mm on ground of 10 N/m; planner and models know of the ground, or do not."""


def rate_group(rate: float) -> str:
    """Name of the runs that learn at ``rate``."""
    return f"rate {rate:.2g}"


def name_of(group: str, kind: str, seed: int = 0) -> str:
    """The study's own name of a run."""
    return f"{group}: {kind}" + (f", seed {seed}" if KINDS[kind].seeded else "")


@dataclass(frozen=True)
class Course:
    """How the errors of a feedforward went, a row for each seed; cycles that a run did not reach are NaN."""

    x: np.ndarray
    """(seeds, cycles): transfer error, mm; so is ``y``."""
    y: np.ndarray
    force: np.ndarray
    """(seeds, cycles): force error over support, N."""
    settled: np.ndarray
    """(seeds, cycles): error of the settled force, %."""
    tilt: np.ndarray
    """(seeds, cycles): largest tilt of a body, mrad; NaN without one."""
    statuses: Sequence[str]

    @property
    def error(self) -> np.ndarray:
        """(seeds, cycles): transfer error in the plane, mm."""
        return np.hypot(self.x, self.y)

    def at(self, values: np.ndarray, cycle: int) -> np.ndarray:
        """Of every seed in ``cycle``; NaN beyond the last."""
        return values[:, cycle - 1] if cycle <= values.shape[1] else np.full(len(values), np.nan)

    @property
    def best(self) -> np.ndarray:
        """(seeds,): index of the cycle with the least transfer error."""
        return np.nanargmin(self.error, axis=1)

    def at_best(self, values: np.ndarray) -> np.ndarray:
        """(seeds,): of the cycle with the least transfer error."""
        return values[np.arange(len(values)), self.best]

    def cycles_to(self, level: float) -> np.ndarray:
        """(seeds,): first cycle from which on the transfer error stays at most ``level`` mm; inf if there is none."""
        above = ~(self.error <= level)
        last = above.shape[1] - above[:, ::-1].argmax(axis=1)
        first = np.where(above.any(axis=1), last + 1.0, 1.0)
        return np.where(first > above.shape[1], np.inf, first)


def course(runs: Sequence[StoredRun]) -> Course:
    """The courses of runs that differ in their seed."""
    tables = [per_cycle(run) for run in runs]
    cycles = max(run.config["cycles"] for run in runs)

    def by_cycle(name: str, factor: float) -> np.ndarray:
        own = [table[name] if name in table else table["force_rmse"] * np.nan for table in tables]
        return factor * np.stack([values.reindex(range(1, cycles + 1)).to_numpy() for values in own])

    return Course(
        by_cycle("transfer_rmse_x", 1e3),
        by_cycle("transfer_rmse_y", 1e3),
        by_cycle("force_rmse", 1.0),
        by_cycle("force_steady_state_error", 100.0),
        by_cycle("tilt_max", 1e3),
        [run.status for run in runs],
    )


def of_kind(runs: Runs, group: str, kind: str) -> dict[str, StoredRun]:
    """Runs of one kind in ``group`` by their name, one for each seed."""
    base = f"{group}: {kind}"
    return {name: run for name, run in runs.items() if name == base or name.startswith(f"{base}, seed ")}


def courses(runs: Runs, group: str) -> dict[str, Course]:
    """The courses of all kinds that ran in ``group``."""
    found = {kind: list(of_kind(runs, group, kind).values()) for kind in KINDS}
    return {kind: course(own) for kind, own in found.items() if own}


def spread(values: np.ndarray, form: str = "") -> str:
    """``mean ± standard deviation`` over seeds, the mean alone of one seed, a dash where a seed has none."""
    if np.isnan(values).any():
        return "-"
    if np.isinf(values).any():
        return "never" if np.isinf(values).all() else f"not with {np.isinf(values).sum()} of {len(values)} seeds"

    def rounded(value: float, below_one: str) -> str:
        return format(value, form) if form else digits(value) if abs(value) >= 1.0 else format(value, below_one)

    mean = rounded(float(values.mean()), ".2g")
    return f"{mean} ± {rounded(float(values.std(ddof=1)), '.1g')}" if len(values) > 1 else mean


def level(alone: Course) -> float:
    """A tenth of the transfer error of feedback alone in its last cycle, mm."""
    return TENTH * float(alone.error[0, -1])


def ranked(found: Mapping[str, float]) -> list[str]:
    """Names by their value, the least first."""
    return sorted(found, key=lambda name: found[name])
