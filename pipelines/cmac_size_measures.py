"""Measures of the study of CMAC sizes: collisions, room, and errors over those of other runs."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.study import Results
from cmacexp.typing import Array

LAYERS, ELEMENTS, INPUTS = "cmac.layers", "cmac.resolution_elements", "cmac.inputs"
MEMORY, ADDRESSING = "cmac.memory_bytes", "cmac.addressing"
SIZE, FREE = "layers and memory", "no collisions"
"""Names of what is varied besides one config key."""
SIDES = ("transfer_rmse_x", "transfer_rmse_y")


def rows_per_cell(run: StoredRun) -> float:
    """Rows of memory for each visited cell of all legs."""
    return _sum(run, "rows") / _sum(run, "cells_visited")


def colliding(run: StoredRun) -> float:
    """Share of the visited cells of all legs that share a row with another one."""
    return _sum(run, "cells_colliding") / _sum(run, "cells_visited")


def _sum(run: StoredRun, key: str) -> int:
    return sum(int(leg[key]) for leg in run.manifest["memory"])


def worsening(own: Results, base: Results, cycle: int | None = None) -> Array:
    """(runs of ``own``,): errors over the mean of ``base``, in x or y, the larger.

    Args:
        own: runs to compare; one that ended early counts as infinitely large.
        base: runs to compare with.
        cycle: whose errors; None: at the end.
    """

    def errors(results: Results, name: str) -> Array:
        return results.end(name) if cycle is None else results.at(cycle, name)

    ratios: Array = np.max([errors(own, side) / errors(base, side).mean() for side in SIDES], axis=0)
    return ratios


def against(own: Mapping[str, Any], base: Mapping[str, Any], cycle: int | None = None) -> Callable[[Results], Array]:
    """A sample: :func:`worsening` of the runs with some settings against those with others."""
    return lambda results: worsening(results.select(own), results.select(base), cycle)


def worsening_where(measure: str, least: float) -> Callable[[Results], Array]:
    """A sample: of the hashed runs in which a measure is at least so large, errors at the end over those of the run
    without collisions."""

    def sample(results: Results) -> Array:
        hashed, free = (results.select({ADDRESSING: way}) for way in ("hashed", "visited"))
        return worsening(hashed, free)[hashed.measure(measure) >= least]

    return sample
