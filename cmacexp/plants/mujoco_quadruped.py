"""Four legs under a floating body in MuJoCo, which stand on the project's elastic ground by friction.

Lin & Song 1997 balance the body in every instant (section 6); here it has mass, so that it rocks, bounces, and moves
only as far as the feet push it.
"""

from dataclasses import dataclass

from cmacexp.config import ComponentConfig, Config, number
from cmacexp.planning.setup import Setup
from cmacexp.plants.environment import make_ground
from cmacexp.plants.mujoco_kernels import Touch
from cmacexp.plants.mujoco_model import Torso, check_inertia, check_masses, make_planar
from cmacexp.plants.mujoco_plant import MujocoPlant, require_machine
from cmacexp.plants.protocol import Measurement


class MujocoQuadruped(MujocoPlant):
    """A floating body on four planar legs with point feet.

    A spring and a damper hold a foot at the point where it touched down, as long as their force stays within the
    limit of friction; beyond it the foot drags the point along.
    """

    @dataclass
    class Config(ComponentConfig):
        """Integration, friction of the feet, inertia of the body, and where the joints start."""

        substeps: int = number("", at_least=1, at_most=10000)
        """Runge-Kutta steps per sampling period."""
        friction: float = number("", above=0, at_most=10)
        """Largest tangential over normal force of a foot (Coulomb)."""
        friction_stiffness: float = number("N/m", above=0, at_most=1e6)
        """Stiffness of the spring that holds a sticking foot."""
        friction_damping: float = number("N s/m", at_least=0, at_most=1e4)
        """Damping beside that spring."""
        body_inertia: list[float] = number("kg m^2", above=0, at_most=1e3)
        """Inertia of the body without its legs about its x, y and z."""
        start_spread: float = number("rad", at_least=0, at_most=0.5)
        """Largest difference of the joint angles at the start from the planned ones."""
        start_seed: int = number("", at_least=0, below=2**32, needs=".start_spread above 0")
        """Seed of the joint angles at the start."""

        def check(self, config: Config) -> None:
            """Check that masses can have such an inertia, and that MuJoCo accepts both."""
            check_masses(config.machine)
            check_inertia(self.body_inertia)

    def __init__(
        self,
        substeps: int,
        friction: float,
        friction_stiffness: float,
        friction_damping: float,
        body_inertia: list[float],
        start_spread: float,
        start_seed: int,
    ):
        self.substeps = substeps
        self.grip = (friction, friction_stiffness, friction_damping)
        self.body_inertia = tuple(body_inertia)
        self.start_spread, self.start_seed = start_spread, start_seed

    def reset(self, setup: Setup) -> Measurement:
        """Start near the planned joint angles, at rest, the body at its planned height.

        Raises:
            BadInput: the machine has no body, or MuJoCo is not installed.
        """
        require_machine(setup, "quadruped", "mujoco_quadruped", "quadruped")
        torso = Torso(setup.config.machine.body_mass, self.body_inertia)
        ground = make_ground(setup.config.terrain, setup.config.sampling_period)
        return self.begin(setup, make_planar(setup.mechanism, torso), Touch(ground, *self.grip))
