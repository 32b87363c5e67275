"""Four legs under a floating body in MuJoCo, which stand on the project's elastic ground by friction.

Lin & Song 1997 balance the body at every instant (section 6); here it has mass, so that it rocks, bounces, and moves
only as far as the feet push it.
"""

from dataclasses import dataclass

from cmacexp.config import number
from cmacexp.planning.plan import Setup
from cmacexp.plants.mujoco_model import make_planar
from cmacexp.plants.mujoco_plant import FrictionConfig, MujocoPlant, require_machine
from cmacexp.protocols import Measurement


class MujocoQuadruped(MujocoPlant):
    """A floating body on four planar legs with point feet.

    A spring and a damper hold a foot at the point where it touched down, as long as their force stays within the
    limit of friction; beyond it the foot drags the point along.
    """

    @dataclass
    class Config(FrictionConfig):
        """Integration, friction of the feet, inertia of the body."""

        body_inertia: list[float] = number("kg m^2", above=0, at_most=1e3)
        """Moments of inertia of the body without its legs about its x, y and z."""

    config: Config

    def reset(self, setup: Setup) -> Measurement:
        """Start near the planned joint angles, at rest, the body at its planned height; raises BadInput."""
        require_machine(setup, "quadruped", "mujoco_quadruped", "quadruped")
        setup = self.config.build(setup)
        inertia = [self.config.mass_factor * moment for moment in self.config.body_inertia]
        model = make_planar(setup.mechanism, self.config.mass_factor * setup.config.machine.body_mass, inertia)
        return self.begin(setup, model, self.config.touch(setup))
