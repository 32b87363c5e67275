"""What a CMAC of some size achieved, and what follows for the paper's claims about memory and collisions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.data.stored_run import StoredRun
from pipelines.analysis.measured import changed, per_cycle

LAYERS, ELEMENTS, MEMORY = "cmac.layers", "cmac.resolution_elements", "cmac.memory_bytes"
INPUTS, RANGE, SEED = "cmac.inputs", "cmac.range_factor", "seed"
SHOWN = (5, 10, 20)
"""Cycles whose errors are shown."""
AS_GOOD = 2.0
"""Errors of the last cycle up to this multiple of those of the paper's size count as no worse."""
ALIKE = 1.25
"""Errors of every cycle shown within this factor of those of the paper's size count as alike."""
LEARNT = 0.25
"""Errors of the last cycle below this fraction of those of the first count as learnt."""
NOTICEABLE = 0.05
"""Share of visited cells that collide from which on the rate of collision counts as noticeable."""
CROWDED = 0.5
"""Share of visited cells that collide from which on memory counts as crowded."""
LITTLE = 0.1
"""Share of the paper's memory below which what is enough counts as little."""


@dataclass(frozen=True)
class Size:
    """A CMAC, how it differs from the paper's, and its results; numbers of several legs are pooled."""

    changed: Mapping[str, Any]
    """Keys and values in which its config differs from the paper's size."""
    x: Mapping[int, float]
    """Transfer error in x by cycle, mm; without cycles that the run did not reach."""
    y: Mapping[int, float]
    force_error: float
    """Signed error of the settled force in the last cycle; NaN if there is none."""
    share: float
    """Share of the feedforward in the last cycle."""
    tilt: float
    """Largest tilt in the last cycle, mrad; NaN without a body."""
    width: float
    """Width of a cell over the planned span of its input."""
    layers: int
    memory: int
    """Bytes of one leg."""
    rows: int
    """Over all legs, as the three that follow."""
    rows_used: int
    cells: int
    colliding: int
    name: str = ""
    """The study's own name of its run."""

    @property
    def rate(self) -> float:
        """Share of the visited cells that share a row with another one."""
        return self.colliding / self.cells

    @property
    def room(self) -> float:
        """Rows of memory for each visited cell."""
        return self.rows / self.cells

    @property
    def bytes_needed(self) -> float:
        """Bytes of one leg if each visited cell had a row of its own."""
        return self.memory / self.room


def measure(name: str, run: StoredRun, base: StoredRun) -> Size:
    """What ``run`` shows; ``base`` has the paper's size."""
    cycles, cmac = per_cycle(run), run.config["cmac"]
    last = cycles.iloc[-1]
    use = {key: sum(leg[key] for leg in run.manifest["memory"]) for key in run.manifest["memory"][0]}
    return Size(
        changed(run.config, base.config),
        (1e3 * cycles["transfer_rmse_x"]).to_dict(),
        (1e3 * cycles["transfer_rmse_y"]).to_dict(),
        float(last["force_steady_state_error"]) if len(run.manifest["memory"]) == 1 else np.nan,
        float(last["feedforward_share"]),
        1e3 * float(last.get("tilt_max", np.nan)),
        cmac["range_factor"] / (cmac["resolution_elements"] - 1),
        cmac["layers"],
        cmac["memory_bytes"],
        use["rows"],
        use["rows_used"],
        use["cells_visited"],
        use["cells_colliding"],
        name,
    )


def differing(sizes: Iterable[Size], *keys: str) -> list[Size]:
    """Those that differ from the paper's size in nothing but ``keys``."""
    return [size for size in sizes if set(size.changed) <= set(keys)]


def paper_size(sizes: Iterable[Size]) -> Size:
    """The one that differs in nothing."""
    return next(size for size in sizes if not size.changed)


def worsening(size: Size, paper: Size) -> float:
    """Last errors over those of the paper's size, in x or y, the larger one; inf if ``size`` ended before."""
    last = max(paper.x)
    if last not in size.x:
        return np.inf
    return max(size.x[last] / paper.x[last], size.y[last] / paper.y[last])


def alike(size: Size, paper: Size) -> bool:
    """Whether no error of the cycles shown is larger than in the paper's size, or not by much."""
    cycles = [cycle for cycle in SHOWN if cycle in paper.x]
    if not set(cycles) <= set(size.x):
        return False
    return all(size.x[k] <= ALIKE * paper.x[k] and size.y[k] <= ALIKE * paper.y[k] for k in cycles)


def remaining(size: Size) -> float:
    """Error of the last cycle over that of the first, in x or y, the larger one."""
    first, last = min(size.x), max(size.x)
    return max(size.x[last] / size.x[first], size.y[last] / size.y[first])


def by_memory(sizes: Sequence[Size]) -> dict[int, list[Size]]:
    """Those that differ in memory or seed alone, by bytes, smallest first: one of each seed of the hash."""
    found: dict[int, list[Size]] = {}
    for size in sorted(differing(sizes, MEMORY, SEED), key=lambda s: s.memory):
        found.setdefault(size.memory, []).append(size)
    return found


def median_worsening(group: Sequence[Size], paper: Size) -> float:
    """Of one size over several seeds."""
    return float(np.median([worsening(size, paper) for size in group]))


def enough_memory(sizes: Sequence[Size]) -> int:
    """Bytes from which on every memory is as good as the paper's."""
    paper, enough = paper_size(sizes), paper_size(sizes).memory
    for memory, group in reversed(by_memory(sizes).items()):
        if median_worsening(group, paper) > AS_GOOD:
            break
        enough = min(enough, memory)
    return enough


def enough_room(sizes: Sequence[Size]) -> float:
    """Rows for each visited cell from which on sizes of any memory, layers and seed are as good as the paper's."""
    paper = paper_size(sizes)
    enough = paper.room
    for size in sorted(differing(sizes, LAYERS, MEMORY, SEED), key=lambda s: -s.room):
        if worsening(size, paper) > AS_GOOD:
            break
        enough = min(enough, size.room)
    return enough


def crowded(sizes: Sequence[Size]) -> dict[int, list[Size]]:
    """Memories in which most cells collide."""
    groups = by_memory(sizes).items()
    return {memory: group for memory, group in groups if np.median([size.rate for size in group]) >= CROWDED}


def verdict_of_rate(sizes: Sequence[Size]) -> str:
    """Of "one can keep the rate of collision below a noticeable level": at the paper's size, or at any."""
    if paper_size(sizes).rate < NOTICEABLE:
        return "reproduced"
    return "reproduced in part" if any(size.rate < NOTICEABLE for size in sizes) else "not reproduced"


def verdict_of_robustness(sizes: Sequence[Size]) -> str:
    """Of "robust to collisions": whether crowded memories are as good as the paper's, or learn at all."""
    paper, groups = paper_size(sizes), crowded(sizes).values()
    good = [median_worsening(group, paper) <= AS_GOOD for group in groups]
    if all(good):
        return "reproduced" if good else "not reproduced"
    if any(good):
        return "reproduced in part"
    learns = any(np.median([remaining(size) for size in group]) <= LEARNT for group in groups)
    return "not reproduced" if learns else "contradicted"


def verdict_of_little(sizes: Sequence[Size]) -> str:
    """Of "little hardware": how much of the paper's memory is enough."""
    share = enough_memory(sizes) / paper_size(sizes).memory
    return "reproduced" if share <= LITTLE else "reproduced in part" if share < 1.0 else "not reproduced"
