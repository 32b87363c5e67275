"""One CMAC per leg as a feedforward."""

from dataclasses import dataclass

import numpy as np

from cmacexp.cmac.network import Cmac
from cmacexp.cmac.quantiser import InputRange, spanning
from cmacexp.cmac.use import memory_use
from cmacexp.config import Config, FeedforwardConfig
from cmacexp.config.component import MemoryNeed
from cmacexp.feedforward.network import BuiltInFeedforward, network, planned_inputs
from cmacexp.planning.setup import Setup
from cmacexp.typing import Weights

CELL_BYTES = 16
"""Bytes of an active cell in the tables of a cycle, while they are made: its row twice, its activation."""
VISIT_BYTES = 38
"""Bytes of an active cell of one leg while the cells that its path visits are counted, which sorts them."""


class CmacFeedforward(BuiltInFeedforward):
    """One CMAC per leg, addressed by planned joint values, trained by the feedback (Lin & Song 1997, section 4)."""

    @dataclass
    class Config(FeedforwardConfig):
        """No fields of its own: those of ``cmac`` and ``learning``."""

        def memory_need(self, config: Config) -> MemoryNeed:
            """Of the cells of every sample: tables of all legs, and finding those that one leg visits."""
            cells = config.steps_per_cycle * config.cmac.layers
            size = cells * (CELL_BYTES * config.legs + VISIT_BYTES)
            return MemoryNeed(size, "cmac.layers", config.cmac.layers)

    def reset(self, setup: Setup) -> None:
        """Compute the cells of every sample; start with empty memories, or with those of an earlier run."""
        config, learnt = setup.config, setup.learnt
        inputs = [planned_inputs(setup, i, config.cmac.inputs) for i in range(setup.mechanism.legs.shape[0])]
        if learnt is None:
            ranges, self.seed = [spanning(own, config.cmac.range_factor) for own in inputs], config.seed
        else:
            ranges, self.seed = [InputRange(*ends) for ends in learnt["ranges"]], int(learnt["seed"])
        self.cmacs = [Cmac(config.cmac, own, setup.mechanism.shape[1], self.seed) for own in ranges]
        for i, cmac in enumerate(self.cmacs):
            if learnt is not None and cmac.visited is not None:
                cmac.visited.positions = learnt[f"visited_{i + 1}"]
        own_cells = [cmac.cells(own) for cmac, own in zip(self.cmacs, inputs, strict=True)]
        activation = np.stack([cmac.activation(own) for cmac, own in zip(self.cmacs, inputs, strict=True)], axis=1)
        self.params = network(setup, np.stack(own_cells, axis=1), self.cmacs[0].address.rows, activation)
        for cmac, own in zip(self.cmacs, self.params.weights, strict=True):
            cmac.weights = own
        if learnt is not None:
            self.params.weights[:] = learnt["weights"]
        self.memory = list(map(memory_use, self.cmacs, inputs, own_cells))

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
