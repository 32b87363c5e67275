"""One CMAC per leg as a feedforward."""

import numpy as np

from cmacexp.cmac.addressing import InputRange, spanning
from cmacexp.cmac.network import Cmac, memory_use
from cmacexp.cmac.receptive_field import RECTANGULAR
from cmacexp.feedforward.network import BuiltInFeedforward, network, planned_inputs
from cmacexp.planning.setup import Setup
from cmacexp.typing import Weights


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
        self.cmacs = [Cmac.from_config(config.cmac, own, setup.mechanism.shape[1], self.seed) for own in ranges]
        for i, cmac in enumerate(self.cmacs):
            if learnt is not None and cmac.visited is not None:
                cmac.visited.positions = learnt[f"visited_{i + 1}"]
        of_legs = list(zip(self.cmacs, inputs, strict=True))
        cells, activation = np.stack([cmac.cells(own) for cmac, own in of_legs], axis=1), None
        if self.cmacs[0].receptive_field != RECTANGULAR:
            activation = np.stack([cmac.activation(own) for cmac, own in of_legs], axis=1)
        self.params = network(setup, cells, self.cmacs[0].address.rows, activation)
        for cmac, own in zip(self.cmacs, self.params.weights, strict=True):
            cmac.weights = own
        self.memory = [memory_use(cmac, own, cells[:, i]) for i, (cmac, own) in enumerate(of_legs)]

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
