"""The feedforwards that are compared, and what the study measures of them: learning, bytes, and time of a step."""

import time

import numpy as np

from cmacexp.config.cmac import WORD_BYTES
from cmacexp.config.compose import compose_config
from cmacexp.data.run import Run
from cmacexp.data.weights import WEIGHTS
from cmacexp.loop import stream
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.final import TRANSFER
from cmacexp.models.mechanism import PLANE
from cmacexp.study import DataFrame, Results
from cmacexp.typing import Array

ALONE, EXACT, CMAC, ANGLES = "feedback only", "exact model", "CMAC", "CMAC of angles"
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
    MLP: ("feedforward._target_=pipelines.perceptron.Perceptron",),
    ILC: ("feedforward=ilc",),
}


def errors(results: Results) -> Array:
    """(runs, cycles): transfer error in the plane, mm; infinite from where a run ended early."""
    found = np.full((len(results), results.value("cycles")), np.inf)
    for cycles, row in zip(found, results.rows, strict=True):
        cycles[: row.run.cycles_done] = 1e3 * row.history(TRANSFER)
    return found


def error_at(results: Results, cycle: int) -> Array:
    """(runs,): transfer error in the plane in one cycle, mm."""
    error: Array = errors(results)[:, cycle - 1]
    return error


def small_error(results: Results) -> float:
    """A tenth of the transfer error of feedback only in its last cycle, mm."""
    return 0.1 * float(errors(results.select(kind=ALONE))[0, -1])


def cycles_to(errors: Array, level: float) -> Array:
    """(runs,): first cycle from which on errors (runs, cycles) stay at most ``level``; infinite if there is none."""
    above = errors > level
    last = above.shape[1] - above[:, ::-1].argmax(axis=1)
    first = np.where(above.any(axis=1), last + 1.0, 1.0)
    return np.where(first > above.shape[1], np.inf, first)


def bytes_held(run: Run) -> float:
    """Bytes of one leg that the feedforward of a run of one leg keeps; NaN if the run keeps no weights."""
    if WEIGHTS not in run.manifest["files"]:
        return float("nan")
    with np.load(run.folder / WEIGHTS) as arrays:
        return float(sum(array.nbytes for array in arrays.values()))


def bytes_used(run: Run) -> float:
    """Of :func:`bytes_held`, those that the path reads; what is read on the way to the weights counts as used."""
    idle = sum(use["rows"] - use["rows_used"] for use in run.manifest.get("memory") or ())
    return bytes_held(run) - float(idle * len(PLANE) * WORD_BYTES)


def measure_costs(results: Results) -> DataFrame:
    """Processor time of a step of one leg by ``kind`` and ``round``, s; that of other programs is not in it.

    The kinds take turns in one process. The perceptron, which works step by step, takes fewer.
    """
    import pandas as pd

    cycles, rounds, stepped_rounds = (2, 3, 3) if max(results.values("cycles")) < 10 else (10, 30, 6)
    configs = {
        kind: compose_config(["scenario=one_leg", "reference=aware", f"cycles={cycles}", *overrides])
        for kind, overrides in {**MODELS, **LEARNERS}.items()
    }
    rows = []
    for turn in range(rounds):
        for kind, config in configs.items():
            if kind == MLP and turn >= stepped_rounds:
                continue
            scenario = make_scenario(config)
            began = time.process_time()
            end = stream(scenario, lambda samples: None)
            seconds = time.process_time() - began
            if turn:  # the first one loads compiled code
                rows.append({"kind": kind, "round": turn, "seconds_per_step": seconds / end.steps})
    return pd.DataFrame(rows)
