"""A machine as MuJoCo describes it: links without extent, point masses at knee and foot, no contacts of its own.

World: x forward, y left, z up. A hinge turns about +y, so that a joint angle counts from +x downwards as ours does.
"""

from cmacexp.arrays import Array
from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import LEGS_UNDER_BODY, Mechanism

POINT = "1e-15 1e-15 1e-15"
"""Inertia of a point mass, kg m^2: MuJoCo refuses none at all."""


def _link(length: float, mass: float, at: str, inside: str = "") -> str:
    """A link along its own x with a point mass at its end, hinged at ``at`` in its parent's frame."""
    return (
        f'<body pos="{at}"><joint type="hinge" axis="0 1 0"/>'
        f'<inertial pos="{length!r} 0 0" mass="{mass!r}" diaginertia="{POINT}"/>{inside}</body>'
    )


def _leg(leg: Array, at: str) -> str:
    """Thigh and shank of one leg, whose row of :class:`Mechanism` is ``leg``, at the hip ``at``."""
    length_1, length_2, mass_1, mass_2 = (float(value) for value in leg[:4])
    return _link(length_1, mass_1, at, _link(length_2, mass_2, f"{length_1!r} 0 0"))


def describe(mechanism: Mechanism, step: float, body_mass: float = 0.0, body_inertia: tuple[float, ...] = ()) -> str:
    """MJCF of a machine.

    Args:
        mechanism: legs on a stand, or legs under a body that floats.
        step: time of one integration step, s.
        body_mass: of the body, kg; only where it floats, and so is the next.
        body_inertia: of the body about its own x, y and z, kg m^2.
    """
    hip_height = float(mechanism.hip_height)
    if mechanism.kind == LEGS_UNDER_BODY:
        legs = "".join(
            _leg(leg, f"{float(x)!r} {float(y)!r} 0") for leg, (x, y) in zip(mechanism.legs, mechanism.hips, strict=True)
        )
        inertia = " ".join(repr(float(value)) for value in body_inertia)
        machine = (
            f'<body pos="0 0 {hip_height!r}"><freejoint/>'
            f'<inertial pos="0 0 0" mass="{body_mass!r}" diaginertia="{inertia}"/>{legs}</body>'
        )
    else:
        machine = "".join(_leg(leg, f"0 0 {hip_height!r}") for leg in mechanism.legs)
    return (
        '<mujoco><compiler angle="radian"/>'
        f'<option timestep="{step!r}" integrator="RK4" gravity="0 0 {-GRAVITY!r}">'
        '<flag constraint="disable"/></option>'
        f"<worldbody>{machine}</worldbody></mujoco>"
    )
