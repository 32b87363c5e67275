"""Where the feet of a robot touch the ground: each is a sphere, found by the name of a geom, a site or a body.

A sphere is its own foot. Any other foot gets a sphere without mass at its point of contact at home: in the lower end
of a capsule, of its radius; at a site; and elsewhere a point, in the middle of the lowest points of the shape.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.models.robot_legs import HINT, list_names
from cmacexp.typing import Array

POINT = 0.001
"""Radius of a foot without one, m."""
FLAT = 0.02
"""Points within this part of the height of a shape count as its lowest."""
Sphere = tuple[int, Array, float]
"""Body, centre (3,) in the world, m, and radius, m."""


def place_feet(mujoco: Any, spec: Any, data: Any, feet: Sequence[str]) -> list[str]:
    """Names of the geoms, all spheres, of the four feet; adds those that are missing to the ``spec`` of a model.

    ``feet`` names geoms, sites or bodies; ``data`` has the trunk level, the legs at home. Raises BadInput.
    """
    found = [_find_foot(mujoco, data.model, data, name) for name in feet]
    bodies = {body.id: body for body in spec.bodies}
    for name, sphere in zip(feet, found, strict=True):
        if sphere:
            body, centre, radius = sphere
            geom = bodies[body].add_geom(name=f"{name} (foot)", type=mujoco.mjtGeom.mjGEOM_SPHERE, mass=0.0, group=3)
            geom.pos, geom.size = (centre - data.xpos[body]) @ data.xmat[body].reshape(3, 3), [radius, 0.0, 0.0]
            geom.contype = geom.conaffinity = 0
    return [f"{name} (foot)" if sphere else name for name, sphere in zip(feet, found, strict=True)]


def _find_foot(mujoco: Any, model: Any, data: Any, name: str) -> Sphere | None:
    """What a name means; None for a geom that is a sphere."""
    kinds = mujoco.mjtObj
    geom, site, body = (
        int(mujoco.mj_name2id(model, kind, name)) for kind in (kinds.mjOBJ_GEOM, kinds.mjOBJ_SITE, kinds.mjOBJ_BODY)
    )
    is_sphere = model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
    if geom >= 0:
        return None if is_sphere[geom] else _touch(mujoco, model, data, geom)
    if site >= 0:
        return int(model.site_bodyid[site]), data.site_xpos[site].copy(), POINT
    if body > 0:
        geoms = np.flatnonzero(model.geom_bodyid == body)
        spheres = geoms[is_sphere[geoms]]
        touching = [_touch(mujoco, model, data, int(k)) for k in (spheres if len(spheres) else geoms)]
        origin = body, data.xpos[body].copy(), POINT
        return min(touching, key=lambda sphere: float(sphere[1][2]) - sphere[2], default=origin)
    named = [model.geom(k).name for k in range(model.ngeom)] + [model.site(k).name for k in range(model.nsite)]
    known = list_names(filter(None, named)) or list_names(model.body(k).name for k in range(1, model.nbody))
    raise BadInput("machine.feet", name, f"is no geom, site or body of the model, which has {known}; {HINT}")


def _touch(mujoco: Any, model: Any, data: Any, geom: int) -> Sphere:
    """Where a geom touches level ground."""
    kind = model.geom_type[geom]
    kinds = mujoco.mjtGeom
    size = model.geom_size[geom]
    body = int(model.geom_bodyid[geom])
    centre = data.geom_xpos[geom]
    turn = data.geom_xmat[geom].reshape(3, 3)
    if kind == kinds.mjGEOM_SPHERE:
        return body, centre.copy(), float(size[0])
    if kind == kinds.mjGEOM_CAPSULE:
        return body, centre - np.sign(turn[2, 2]) * size[1] * turn[:, 2], float(size[0])
    angle, level = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False), np.linspace(-1.0, 1.0, 17))
    width = 1.0 if kind == kinds.mjGEOM_CYLINDER else np.sqrt(1.0 - level**2)
    if kind == kinds.mjGEOM_MESH:
        first, count = (int(values[model.geom_dataid[geom]]) for values in (model.mesh_vertadr, model.mesh_vertnum))
        points = model.mesh_vert[first : first + count]
    elif kind == kinds.mjGEOM_BOX:
        points = size * np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    else:
        size = size[[0, 0, 1]] if kind == kinds.mjGEOM_CYLINDER else size
        points = size * np.stack([width * np.cos(angle), width * np.sin(angle), level], axis=-1).reshape(-1, 3)
    world = centre + points @ turn.T
    low = world[:, 2] - world[:, 2].min() <= FLAT * np.ptp(world[:, 2])
    return body, world[low].mean(axis=0), POINT
