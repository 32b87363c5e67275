"""Ground that stays as it is, and a body on which nothing is put."""

from cmacexp.models.body import Load
from cmacexp.models.ground import ALL_LEGS, NEVER, Ground
from cmacexp.plants.kernels import Payload

NO_PAYLOAD = Payload(Load(0.0, 0.0, 0.0), NEVER)


def still_ground(stiffness, patch_size=1.0, patch_spread=0.0, patch_seed=0, damping=0.0):
    """Flat ground whose stiffness never steps."""
    return Ground(stiffness, patch_size, patch_spread, patch_seed, damping, NEVER, 1.0, ALL_LEGS, 0.0, 0.0)
