"""An identified model below a CMAC: ``feedforward._target_=pipelines.cmac_on_identified.CmacOnIdentified``."""

import numpy as np

from cmacexp.cmac.addressing import InputRange, spanning
from cmacexp.cmac.network import Cmac
from cmacexp.feedforward.identified import IdentifiedModel
from cmacexp.feedforward.network import planned_inputs
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Weights


class CmacOnIdentified(IdentifiedModel):
    """What the identified joints do not explain of a cycle trains a CMAC for each leg after the cycle.

    The CMACs are those of ``cmac``. They learn what feedforward and feedback supplied together beside the model as it
    is after its fit, so that the two do not learn the same twice.
    """

    def reset(self, setup: Setup) -> None:
        """Start with empty memories, or with those of an earlier run."""
        legs, joints = setup.mechanism.shape
        config, learnt, self.cmacs = setup.config, setup.learnt, list[Cmac]()
        self.inputs = [planned_inputs(setup, i, config.cmac.inputs) for i in range(legs)]
        for i, own in enumerate(self.inputs):
            ends = spanning(own, config.cmac.range_factor) if learnt is None else InputRange(*learnt["ends"][i])
            self.cmacs.append(Cmac.from_config(config.cmac, ends, joints, config.seed))
            if learnt is not None:
                self.cmacs[i].weights[:] = learnt["memory"][i]
        self.rate = setup.rate
        super().reset(setup)

    def _compute_torque(self) -> Array:
        above = [cmac.predict(own) for cmac, own in zip(self.cmacs, self.inputs, strict=True)]
        return super()._compute_torque() + np.stack(above, axis=1)

    def _identify(self) -> None:
        super()._identify()
        left = self.wanted - super()._compute_torque()
        for cmac, own, torque in zip(self.cmacs, self.inputs, left.swapaxes(0, 1), strict=True):
            for x, wanted in zip(own, torque, strict=True):
                cmac.update(x, wanted - cmac.predict(x), self.rate)
        self.torque = self._compute_torque()

    def learnt(self) -> Weights:
        """Those of the model; ``memory`` (L, rows, J), N m, and ``ends`` (L, 2, n) of the inputs of the CMACs."""
        ends = np.stack([np.stack(cmac.address.ranges) for cmac in self.cmacs])
        return {**super().learnt(), "memory": np.stack([cmac.weights for cmac in self.cmacs]), "ends": ends}
