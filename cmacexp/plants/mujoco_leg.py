"""The leg on its stand in MuJoCo: an independent check of the project's equations of motion."""

from cmacexp.planning.plan import Setup
from cmacexp.plants.as_built import make_ground
from cmacexp.plants.mujoco_model import make_planar
from cmacexp.plants.mujoco_plant import MujocoConfig, MujocoPlant, require_machine
from cmacexp.plants.touch import Touch
from cmacexp.protocols import Measurement


class MujocoLeg(MujocoPlant):
    """One leg on a stand, on the project's elastic ground, without friction."""

    Config = MujocoConfig
    config: MujocoConfig

    def reset(self, setup: Setup) -> Measurement:
        """Start at the planned joint angles, at rest; raises BadInput if the machine is not a leg on a stand."""
        require_machine(setup, "leg", "mujoco_leg", "one_leg")
        setup = self.config.build(setup)
        ground = make_ground(setup.config.terrain, setup.config.sampling_period)
        return self.begin(setup, make_planar(setup.mechanism), Touch(ground))
