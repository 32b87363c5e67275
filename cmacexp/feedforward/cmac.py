"""One CMAC per leg as a feedforward."""

import copy
from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cmacexp.cmac.addressing import InputRange, spanning
from cmacexp.cmac.network import Cmac, MemoryUse, memory_use
from cmacexp.cmac.receptive_field import RECTANGULAR
from cmacexp.feedforward.network import BuiltInFeedforward, network, planned_inputs
from cmacexp.feedforward.weight_log import WeightLog, new_log
from cmacexp.jit.compiler import workload
from cmacexp.planning.plan import recall
from cmacexp.planning.setup import Setup
from cmacexp.typing import Array, Cells, Weights


class _Path(NamedTuple):
    """CMACs, one for each leg, and what they find along the planned inputs of their legs."""

    cmacs: list[Cmac]
    cells: Cells
    """(N, L, C): active rows at each sample."""
    activation: Array | None
    """(N, L, C): of these cells; None if all are 1."""
    log: WeightLog
    """Empty, of these cells."""
    memory: list[MemoryUse]
    """Of each leg."""


_paths = deque[Any](maxlen=16)


def _follow(setup: Setup, inputs: Sequence[Array], ranges: Sequence[InputRange], seed: int) -> _Path:
    """What new CMACs of given ranges find along inputs (N, n) of each leg; with ``visited`` cells they note them."""
    cmacs = [Cmac.from_config(setup.config.cmac, own, setup.mechanism.shape[1], seed) for own in ranges]
    for i, cmac in enumerate(cmacs):
        if setup.learnt is not None and cmac.visited is not None:
            cmac.visited.positions = setup.learnt[f"visited_{i + 1}"]
    of_legs = list(zip(cmacs, inputs, strict=True))
    activation = None
    with workload(len(inputs) * len(inputs[0])):  # one run does not repay compiling, many do
        cells = np.stack([cmac.cells(own) for cmac, own in of_legs], axis=1)
        memory = [memory_use(cmac, own, cells[:, i]) for i, (cmac, own) in enumerate(of_legs)]
    if cmacs[0].receptive_field != RECTANGULAR:
        activation = np.stack([cmac.activation(own) for cmac, own in of_legs], axis=1)
    return _Path(cmacs, cells, activation, new_log(cells), memory)


class CmacFeedforward(BuiltInFeedforward):
    """One CMAC per leg, addressed by planned joint values, trained by the feedback (Lin & Song 1997, section 4)."""

    def reset(self, setup: Setup) -> None:
        """Compute the cells of every sample; start with empty memories, or with those of an earlier run."""
        config, learnt = setup.config, setup.learnt
        inputs = [planned_inputs(setup, i, config.cmac.inputs) for i in range(setup.mechanism.shape[0])]
        if learnt is None:
            ranges, self.seed = [spanning(own, config.cmac.range_factor) for own in inputs], config.seed
        else:
            ranges, self.seed = [InputRange(*ends) for ends in learnt["ranges"]], int(learnt["seed"])
        follow = partial(_follow, setup, inputs, ranges, self.seed)
        path_inputs = [values.tobytes() for values in (*inputs, *np.array(ranges))]
        known = self.seed, path_inputs, setup.mechanism.shape, config.cmac
        # Visited cells follow from what was learnt, too.
        path: _Path = follow() if config.cmac.addressing == "visited" else recall(_paths, known, follow)
        self.cmacs, self.memory = list(map(copy.copy, path.cmacs)), path.memory
        self.params = network(setup, path.cells, self.cmacs[0].address.rows, path.activation, log=path.log)
        for cmac, own in zip(self.cmacs, self.params.weights, strict=True):
            cmac.weights = own

    def learnt(self) -> Weights:
        """``weights`` (L, rows, J), N m; ``ranges`` (L, 2, n) of the inputs, low and high; ``seed`` of the hash.

        With visited addressing also ``visited_1`` and so on, the cells of each leg in the order of their rows.
        """
        ranges = np.stack([np.stack(cmac.address.ranges) for cmac in self.cmacs])
        visited = {
            f"visited_{i + 1}": cmac.visited.positions
            for i, cmac in enumerate(self.cmacs)
            if cmac.visited is not None
        }
        seed = np.array(self.seed, dtype=float)
        return {"weights": self.params.weights.copy(), "ranges": ranges, "seed": seed, **visited}
