"""A planar machine as a MuJoCo model: links without extent, point masses at knee and foot, no contacts.

World: x forward, y left, z up. A hinge turns about +y, so that joint angles count from +x downwards, as in the whole
project.
"""

from collections.abc import Sequence

import numpy as np

from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import Mechanism
from cmacexp.models.robot import refusals_named
from cmacexp.plants.mujoco_plant import Model
from cmacexp.typing import Array


def _link(name: str, length: float, mass: float, at: str, inside: str) -> str:
    """Format the XML of a link along its own x with a point mass at its end.

    It is hinged at ``at`` in the frame of its parent and contains the XML ``inside``.
    """
    return (
        f'<body pos="{at}"><joint name="{name}" type="hinge" axis="0 1 0"/>'
        f'<inertial pos="{length!r} 0 0" mass="{mass!r}"/>{inside}</body>'
    )


def _leg(number: int, leg: Array, at: str) -> str:
    """Format the XML of a leg at the hip ``at``: thigh, shank, and a geom as its foot.

    ``leg`` is its row of :class:`Mechanism`.
    """
    length_1, length_2, mass_1, mass_2 = (float(value) for value in leg[:4])
    foot = f'<geom size="0.01" pos="{length_2!r} 0 0"/>'
    shank = _link(f"joint 2 of leg {number}", length_2, mass_2, f"{length_1!r} 0 0", foot)
    return _link(f"joint 1 of leg {number}", length_1, mass_1, at, shank)


def make_planar(mechanism: Mechanism, body_mass: float | None = None, inertia: Sequence[float] = ()) -> Model:
    """Make the model of planar legs on a stand, or under a floating body of ``body_mass``, kg, without its legs.

    The centre of the body is in the plane of the hips, ``inertia`` is about its own x, y and z, kg m^2. Raises
    BadInput if MuJoCo refuses a mass or an inertia.
    """
    origin = np.array([0.0, 0.0, mechanism.hip_height if body_mass is None else 0.0])
    hips = [f"{float(x)!r} {float(y)!r} {float(origin[2])!r}" for x, y in mechanism.hips]
    machine = "".join(_leg(i + 1, leg, hip) for i, (leg, hip) in enumerate(zip(mechanism.legs, hips, strict=True)))
    if body_mass is not None:
        moments = " ".join(repr(float(value)) for value in inertia)
        machine = (
            '<body><freejoint name="the body"/>'
            f'<inertial pos="0 0 0" mass="{float(body_mass)!r}" diaginertia="{moments}"/>{machine}</body>'
        )
    trunk = int(body_mass is not None)
    xml = (
        # boundinertia is that of a point mass: the least that MuJoCo accepts, its mjMINVAL
        f'<mujoco><compiler angle="radian" boundinertia="1e-15"/><option integrator="RK4" gravity="0 0 {-GRAVITY!r}">'
        f'<flag constraint="disable" autoreset="disable"/></option><worldbody>{machine}</worldbody></mujoco>'
    )
    with refusals_named("plant", "mujoco") as mujoco:
        model = mujoco.MjModel.from_xml_string(xml)
    legs = np.arange(len(mechanism.legs))
    return Model(model, trunk, trunk + np.stack([2 * legs, 2 * legs + 1], axis=1), legs, origin)
