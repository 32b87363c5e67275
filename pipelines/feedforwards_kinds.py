"""The feedforwards that are compared, and what the study measures of them."""

import numpy as np

from cmacexp.config.cmac import OUTPUTS, WORD_BYTES
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.weights import WEIGHTS
from cmacexp.study import Results
from cmacexp.typing import Array

ALONE, EXACT, CMAC, ANGLES = "feedback alone", "exact model", "CMAC", "CMAC of angles"
RBF, MLP, ILC = "RBF", "MLP", "ILC"
LIGHT, HEAVY = "masses 20 % too light", "masses 20 % too heavy"
MODELS: dict[str, tuple[str, ...]] = {
    ALONE: ("feedforward=none",),
    EXACT: ("feedforward=inverse_dynamics",),
    LIGHT: ("feedforward=inverse_dynamics", "feedforward.mass_factor=0.8"),
    HEAVY: ("feedforward=inverse_dynamics", "feedforward.mass_factor=1.2"),
}
"""What does not learn, by the overrides that choose it."""
LEARNERS: dict[str, tuple[str, ...]] = {
    CMAC: ("feedforward=cmac",),
    ANGLES: ("feedforward=cmac", "cmac.inputs=[angle]"),
    RBF: ("feedforward=rbf",),
    MLP: ("feedforward=mlp",),
    ILC: ("feedforward=ilc",),
}
SEEDED = (CMAC, ANGLES, MLP)
"""What depends on the seed: the hash of a CMAC, the initial weights of the perceptron."""
KEPT = (CMAC, RBF, MLP, ILC)
"""Learners whose weights are carried over to another ground or path."""
TENTH = 0.1
"""Transfer error over that of feedback alone at which learning counts as done."""


def plane_error(results: Results) -> Array:
    """(runs, cycles): transfer error in the plane, mm; infinite from where a run ended early."""
    pairs = zip(results.history("transfer_rmse_x"), results.history("transfer_rmse_y"), strict=True)
    errors = np.full((len(results), results.value("cycles")), np.inf)
    for row, (x, y) in zip(errors, pairs, strict=True):
        row[: len(x)] = 1e3 * np.hypot(x, y)
    return errors


def error_at(results: Results, cycle: int) -> Array:
    """(runs,): transfer error in the plane in one cycle, mm."""
    error: Array = plane_error(results)[:, cycle - 1]
    return error


def small_error(results: Results) -> float:
    """A tenth of the transfer error of feedback alone in its last cycle, mm."""
    return TENTH * float(plane_error(results.select(kind=ALONE))[0, -1])


def cycles_to(errors: Array, level: float) -> Array:
    """(runs,): first cycle from which on errors (runs, cycles) stay at most ``level``; infinite if there is none."""
    above = errors > level
    last = above.shape[1] - above[:, ::-1].argmax(axis=1)
    first = np.where(above.any(axis=1), last + 1.0, 1.0)
    return np.where(first > above.shape[1], np.inf, first)


def cycles_to_tenth(results: Results, kind: str, start: str | None = None) -> Array:
    """(seeds,): cycles that a learner needs to a tenth of the error of feedback alone."""
    own = results.select(kind=kind) if start is None else results.select(kind=kind, start=start)
    return cycles_to(plane_error(own), small_error(results))


def bytes_held(run: StoredRun) -> float:
    """Bytes of one leg that the feedforward of a run of one leg keeps; NaN if the run keeps no weights."""
    if WEIGHTS not in run.manifest["files"]:
        return float("nan")
    with np.load(run.folder / WEIGHTS) as arrays:
        return float(sum(array.nbytes for array in arrays.values()))


def bytes_used(run: StoredRun) -> float:
    """Of :func:`bytes_held`, those that the path reads; what is read on the way to the weights counts as used."""
    idle = sum(use["rows"] - use["rows_used"] for use in run.manifest.get("memory") or ())
    return bytes_held(run) - float(idle * OUTPUTS * WORD_BYTES)
