"""Feedforward with one CMAC per leg, which learns the whole torque or only the error of a model."""

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
    """Addresses of one CMAC per leg along its planned inputs; read-only, because many runs share it."""

    cmacs: list[Cmac]
    """One per leg, without weights."""
    activation: Array | None
    """(N, L, C): activations of the active cells; None if all are 1."""
    cells: Cells
    """(N, L, C): active rows."""
    memory: list[MemoryUse]
    """Memory use of each leg."""
    log: WeightLog
    """Empty log of the weights in these rows."""


def _address_path(setup: Setup, inputs: Sequence[Array], seed: int, key: tuple[Any, ...]) -> _Path:
    """Compute the active rows of one CMAC per leg along its planned ``inputs`` (N, n).

    The input ranges span the inputs, unless an earlier run has stored its ranges. Cells before hashing depend on
    ``key`` but not on the ``seed`` of the hash, so they are shared by runs with an equal key.
    """
    config = setup.config.cmac
    learnt = setup.learnt
    if learnt is None:
        ranges = [spanning(leg_inputs, config.range_factor) for leg_inputs in inputs]
    else:
        ranges = [InputRange(*ends) for ends in learnt["ranges"]]
    cmacs = [Cmac.from_config(config, leg_range, setup.mechanism.shape[1], seed) for leg_range in ranges]
    for leg, cmac in enumerate(cmacs):
        if learnt is not None and cmac.visited is not None:
            cmac.visited.positions = learnt[f"visited_{leg + 1}"]
    legs = list(zip(cmacs, inputs, strict=True))
    cells = np.stack([cmac.cells(leg_inputs) for cmac, leg_inputs in legs], axis=1)
    is_binary = cmacs[0].receptive_field == RECTANGULAR
    activation = None if is_binary else np.stack([cmac.activation(path) for cmac, path in legs], axis=1)
    visited = setup.recall.get(key, lambda: [find_visited(*leg) for leg in legs])
    memory = [memory_use(*leg, cells[:, i], visited[i]) for i, leg in enumerate(legs)]
    return _Path(cmacs, activation, cells, memory, find_rows(cells))


class CmacFeedforward(BuiltInFeedforward):
    """One CMAC per leg, addressed by planned joint values, trained by the feedback (Lin & Song 1997, section 4)."""

    def reset(self, setup: Setup) -> None:
        """Compute the active cells of every sample; start with zero weights, or with those of an earlier run."""
        config = setup.config
        learnt = setup.learnt
        inputs = [planned_inputs(setup, i, config.cmac.inputs) for i in range(setup.mechanism.shape[0])]
        self.seed = config.seed if learnt is None else int(learnt["seed"])
        ranges = None if learnt is None else np.asarray(learnt["ranges"]).tobytes()
        key = [leg_inputs.tobytes() for leg_inputs in inputs], setup.mechanism.shape, config.cmac, ranges
        with workload(len(inputs) * len(inputs[0])):  # compiling pays off for many runs, not for one
            address_path = partial(_address_path, setup, inputs, self.seed, key)
            path: _Path = setup.recall.get((*key, self.seed), address_path) if learnt is None else address_path()
        self.cmacs = [cmac.copy_empty() for cmac in path.cmacs]
        self.memory = path.memory
        params = network(setup, path.cells, self.cmacs[0].address.rows, path.activation, log=path.log)
        learning = params.learning._replace(
            weight_step=config.cmac.weight_step, weight_limit=config.cmac.weight_limit
        )
        self.params = params._replace(learning=learning)
        for cmac, weights in zip(self.cmacs, self.params.weights, strict=True):
            cmac.weights = weights

    def learnt(self) -> Weights:
        """Return ``weights`` (L, rows, J), N m; input ``ranges`` (L, 2, n), low and high; ``seed`` of the hash.

        With visited addressing also ``visited_1`` to ``visited_L``: the cells of each leg in the order of their rows.
        """
        ranges = np.stack([np.stack(cmac.address.ranges) for cmac in self.cmacs])
        visited = {
            f"visited_{i + 1}": cmac.visited.positions
            for i, cmac in enumerate(self.cmacs)
            if cmac.visited is not None
        }
        return {
            "weights": self.params.weights.copy(),
            "ranges": ranges,
            "seed": np.array(self.seed, dtype=float),
            **visited,
        }


class CmacOnModel(CmacFeedforward):
    """Inverse dynamics with a model that may have errors, plus a CMAC that learns the remaining feedback torque.

    The torque of the model acts from the first step in which the feedforward acts.
    """

    Config = InverseDynamics.Config

    def __init__(self, config: InverseDynamics.Config):
        super().__init__(config)
        self.model = InverseDynamics(config)

    def reset(self, setup: Setup) -> None:
        """Compute the torque of the model; start with zero weights, or with those of an earlier run."""
        super().reset(setup)
        self.model_torque = self.model.compute_torque(setup)
        self.params = self.params._replace(torque=self.model_torque)
