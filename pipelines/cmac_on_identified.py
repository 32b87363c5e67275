"""An identified model below a CMAC: ``feedforward._target_=pipelines.cmac_on_identified.CmacOnIdentified``."""

import numpy as np

from cmacexp.cmac.addressing import InputRange, spanning
from cmacexp.cmac.network import Cmac
from cmacexp.feedforward.identified import IdentifiedModel
from cmacexp.feedforward.network import planned_inputs
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Weights


class CmacOnIdentified(IdentifiedModel):
    """Identified joint model with one CMAC per leg, trained after each cycle with the residual torque of the model.

    The CMACs have the parameters of the config group ``cmac``. The residual is the sum of feedforward and feedback
    torque minus the torque of the model after its fit, so that model and CMACs do not learn the same torque twice.
    """

    def reset(self, setup: Setup) -> None:
        """Start with zero weights, or with those of an earlier run."""
        legs, joints = setup.mechanism.shape
        config = setup.config
        learnt = setup.learnt
        self.cmacs = list[Cmac]()
        self.inputs = [planned_inputs(setup, i, config.cmac.inputs) for i in range(legs)]
        for i, inputs in enumerate(self.inputs):
            ends = spanning(inputs, config.cmac.range_factor) if learnt is None else InputRange(*learnt["ends"][i])
            self.cmacs.append(Cmac.from_config(config.cmac, ends, joints, config.seed))
            if learnt is not None:
                self.cmacs[i].weights[:] = learnt["memory"][i]
        self.rate = setup.rate
        super().reset(setup)

    def _compute_torque(self) -> Array:
        corrections = [cmac.predict(inputs) for cmac, inputs in zip(self.cmacs, self.inputs, strict=True)]
        return super()._compute_torque() + np.stack(corrections, axis=1)

    def _identify(self) -> None:
        super()._identify()
        residual = self.wanted - super()._compute_torque()
        for cmac, inputs, torque in zip(self.cmacs, self.inputs, residual.swapaxes(0, 1), strict=True):
            for x, wanted in zip(inputs, torque, strict=True):
                cmac.update(x, wanted - cmac.predict(x), self.rate)
        self.torque = self._compute_torque()

    def learnt(self) -> Weights:
        """Return the learnt parameters of the model and of the CMACs.

        ``memory`` (L, rows, J), N m, holds the weights of the CMACs, ``ends`` (L, 2, n) the limits of their inputs.
        """
        ends = np.stack([np.stack(cmac.address.ranges) for cmac in self.cmacs])
        return {**super().learnt(), "memory": np.stack([cmac.weights for cmac in self.cmacs]), "ends": ends}
