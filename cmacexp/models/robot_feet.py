"""Where the feet of a robot touch the ground: each is a sphere, found by the name of a geom, a site or a body.

A sphere is its own foot. Any other foot gets a sphere without mass at its point of contact at home: in the lower end
of a capsule, of its radius; at a site; and elsewhere a point, in the middle of the lowest points of the shape.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.models.robot_legs import HINT, list_names
from cmacexp.typing import Array

POINT = 0.001
"""Radius of a foot without one, m."""
FLAT = 0.02
"""Points of a shape that are lowest, all but this part of the height of the shape."""


class Foot(NamedTuple):
    """A sphere that touches the ground."""

    body: int
    """To which it is fixed."""
    place: Array
    """(3,) its centre in the world, m."""
    radius: float
    """m."""


def place_feet(mujoco: Any, spec: Any, data: Any, feet: Sequence[str]) -> list[str]:
    """Names of the geoms, all spheres, of the four feet; adds those that are missing to ``spec``.

    Args:
        mujoco: the module.
        spec: of the model.
        data: of its compiled model, the trunk level, the legs at home.
        feet: names of geoms, sites or bodies.

    Raises:
        BadInput: nothing in the model has such a name.
    """
    found = [_find_foot(mujoco, data.model, data, name) for name in feet]
    bodies = {body.id: body for body in spec.bodies}
    names = []
    for name, foot in zip(feet, found, strict=True):
        if isinstance(foot, Foot):
            turn = data.xmat[foot.body].reshape(3, 3)
            place = (foot.place - data.xpos[foot.body]) @ turn
            kind, name = mujoco.mjtGeom.mjGEOM_SPHERE, f"{name} (foot)"
            size = [foot.radius, 0.0, 0.0]
            bodies[foot.body].add_geom(
                name=name, type=kind, size=size, pos=place, mass=0.0, contype=0, conaffinity=0, group=3
            )
        names.append(name)
    return names


def _find_foot(mujoco: Any, model: Any, data: Any, name: str) -> Foot | None:
    """What a name means; None for a geom that is a sphere."""

    def find(kind: str) -> int:
        return int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), name))

    if (geom := find("GEOM")) >= 0:
        is_sphere = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE
        return None if is_sphere else _touch(mujoco, model, data, [geom])
    if (site := find("SITE")) >= 0:
        return Foot(int(model.site_bodyid[site]), data.site_xpos[site].copy(), POINT)
    if (body := find("BODY")) > 0:
        geoms = np.flatnonzero(model.geom_bodyid == body)
        spheres = geoms[model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE]
        return _touch(mujoco, model, data, spheres if len(spheres) else geoms, body)
    raise BadInput("machine.feet", name, f"is no geom, site or body of the model, which has {_known(model)}; {HINT}")


def _known(model: Any) -> str:
    """Names that a foot may have."""
    named = [model.geom(k).name for k in range(model.ngeom)] + [model.site(k).name for k in range(model.nsite)]
    return list_names(filter(None, named)) or list_names(model.body(k).name for k in range(1, model.nbody))


def _touch(mujoco: Any, model: Any, data: Any, geoms: Iterable[int], body: int = 0) -> Foot:
    """Where the lowest of some geoms of a body touches the ground; the origin of the ``body`` if there are none."""
    feet = [_touch_one(mujoco, model, data, int(geom)) for geom in geoms]
    if not feet:
        return Foot(body, data.xpos[body].copy(), POINT)
    return min(feet, key=lambda foot: float(foot.place[2]) - foot.radius)


def _touch_one(mujoco: Any, model: Any, data: Any, geom: int) -> Foot:
    kind, kinds, size = model.geom_type[geom], mujoco.mjtGeom, model.geom_size[geom]
    body, place, turn = int(model.geom_bodyid[geom]), data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    if kind == kinds.mjGEOM_SPHERE:
        return Foot(body, place.copy(), float(size[0]))
    if kind == kinds.mjGEOM_CAPSULE:
        ends = place + np.outer([size[1], -size[1]], turn[:, 2])
        return Foot(body, ends[np.argmin(ends[:, 2])], float(size[0]))
    if kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
    elif kind == kinds.mjGEOM_BOX:
        points = size * np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    else:
        is_cylinder = kind == kinds.mjGEOM_CYLINDER
        around = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        points = [
            [(width := 1.0 if is_cylinder else np.sqrt(1.0 - z * z)) * np.cos(angle), width * np.sin(angle), z]
            for z in np.linspace(-1.0, 1.0, 17)
            for angle in around
        ] * (size[[0, 0, 1]] if is_cylinder else size)
    world = place + points @ turn.T
    height = world[:, 2]
    lowest = height <= height.min() + FLAT * np.ptp(height)
    return Foot(body, world[lowest].mean(axis=0), POINT)
