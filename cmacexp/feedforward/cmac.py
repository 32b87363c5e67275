"""One CMAC per leg as a feedforward; it learns all of the torque, or what a model of the machine lacks."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cmacexp.cmac.addressing import RECTANGULAR, InputRange, spanning
from cmacexp.cmac.network import Cmac, find_visited, memory_use
from cmacexp.data.records import MemoryUse
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.kernels import WeightLog, find_rows
from cmacexp.feedforward.network import BuiltInFeedforward, network, planned_inputs
from cmacexp.jit.compiler import workload
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Cells, Weights


class _Path(NamedTuple):
    """What CMACs, one for each leg, find along planned inputs; nothing changes it, since many runs share it."""

    cmacs: list[Cmac]
    """Without weights."""
    activation: Array | None
    """(N, L, C): of the active cells; None if all are 1."""
    cells: Cells
    """(N, L, C): active rows."""
    memory: list[MemoryUse]
    log: WeightLog


def _follow(setup: Setup, inputs: Sequence[Array], seed: int, key: tuple[Any, ...]) -> _Path:
    """Follow inputs (N, n) of each leg, which span the ranges of its CMAC unless these have been learnt.

    What follows from ``key`` alone, whatever the ``seed`` of the hash is, is recalled.
    """
    config, learnt, joints = setup.config.cmac, setup.learnt, setup.mechanism.shape[1]
    ranges = [spanning(own, config.range_factor) for own in inputs]
    if learnt is not None:
        ranges = [InputRange(*ends) for ends in learnt["ranges"]]
    cmacs = [Cmac.from_config(config, own, joints, seed) for own in ranges]
    for leg, cmac in enumerate(cmacs):
        if learnt is not None and cmac.visited is not None:
            cmac.visited.positions = learnt[f"visited_{leg + 1}"]
    of_legs = list(zip(cmacs, inputs, strict=True))
    cells = np.stack([cmac.cells(own) for cmac, own in of_legs], axis=1)
    activation = None
    if cmacs[0].receptive_field != RECTANGULAR:
        activation = np.stack([cmac.activation(own) for cmac, own in of_legs], axis=1)
    visited = setup.recall.get(key, lambda: [find_visited(*leg) for leg in of_legs])
    memory = [memory_use(*leg, cells[:, i], visited[i]) for i, leg in enumerate(of_legs)]
    return _Path(cmacs, activation, cells, memory, find_rows(cells))


class CmacFeedforward(BuiltInFeedforward):
    """One CMAC per leg, addressed by planned joint values, trained by the feedback (Lin & Song 1997, section 4)."""

    def reset(self, setup: Setup) -> None:
        """Compute the cells of every sample; start with empty memories, or with those of an earlier run."""
        config, learnt = setup.config, setup.learnt
        inputs = [planned_inputs(setup, i, config.cmac.inputs) for i in range(setup.mechanism.shape[0])]
        self.seed = config.seed if learnt is None else int(learnt["seed"])
        ranges = None if learnt is None else np.asarray(learnt["ranges"]).tobytes()
        key = [own.tobytes() for own in inputs], setup.mechanism.shape, config.cmac, ranges
        with workload(len(inputs) * len(inputs[0])):  # one run does not repay compiling, many do
            follow = partial(_follow, setup, inputs, self.seed, key)
            path: _Path = setup.recall.get((*key, self.seed), follow) if learnt is None else follow()
        self.cmacs = [cmac.copy_empty() for cmac in path.cmacs]
        self.memory = path.memory
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


class CmacOnModel(CmacFeedforward):
    """Inverse dynamics with a model that may be wrong, plus a CMAC that learns what feedback is still needed.

    The torque of the model acts from the first step that the feedforward acts in.
    """

    Config = InverseDynamics.Config

    def __init__(self, config: InverseDynamics.Config):
        super().__init__(config)
        self.model = InverseDynamics(config)

    def reset(self, setup: Setup) -> None:
        """Compute the torque of the model; start with empty memories, or with those of an earlier run."""
        super().reset(setup)
        self.model_torque = self.model.compute_torque(setup)
        self.params = self.params._replace(torque=self.model_torque)
