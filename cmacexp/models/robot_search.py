"""Search for the legs of a model by the tree of its bodies: names of joints and feet, and a home with bent knees."""

import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cmacexp.errors import require
from cmacexp.models.chain import chain_angles, chain_points, make_chains
from cmacexp.models.robot import compile_spec, load_mujoco, load_spec, set_posture
from cmacexp.models.robot_gains import HEIGHT_OF_LINKS
from cmacexp.models.robot_legs import JOINTS, LEGS, find_chain, list_names, require_frame
from cmacexp.typing import Array

STARTS = tuple(itertools.product((0.0,), (0.9, -0.9, 0.0), (-1.8, 1.8, -0.9, 0.9)))
"""Joint angles of a leg, rad, from which its home is searched; the first of equally good results counts."""
DIGITS = 2
"""Decimals of a home angle, rad."""
NEAR = 0.8
"""Distance from the knee, over that of the farthest sphere, above which a sphere with a name is taken as the foot."""


class Names(NamedTuple):
    """Values of ``machine.joints``, ``machine.feet`` and ``machine.home`` for a model."""

    joints: list[list[str]]
    feet: list[str]
    home: list[Any]


def find_names(path: Path) -> Names:
    """Find joints, feet and home of a model, with the legs front left, front right, rear left, rear right.

    Raises BadInput if the file is no model, has no four chains of three hinges on a trunk that floats, or is turned.
    """
    mujoco = load_mujoco()
    model = compile_spec(path, load_spec(path))
    body_chains = [find_chain(model, body) for body in sorted(set(model.jnt_bodyid.tolist()))]
    inner = {k for chain in body_chains for k in chain[:-1]}
    types = [int(mujoco.mjtJoint.mjJNT_FREE), *[int(mujoco.mjtJoint.mjJNT_HINGE)] * JOINTS]
    chains = [c[1:] for c in body_chains if c[-1] not in inner and model.jnt_type[c].tolist() == types]
    ends = list_names(model.joint(chain[-1]).name for chain in chains) or "none"
    reason = f"has {len(chains)} chains of three hinges on a trunk that floats, not four; they end at {ends}"
    require(len(chains) == LEGS, "machine.path", path, reason)
    data = set_posture(model, mujoco.MjData(model), np.array(chains), np.zeros(JOINTS))
    thighs = [chain[1] for chain in chains]
    hips = data.xanchor[thighs]
    # Thighs turn about the lateral axis; if that is not y, the frame of the trunk is turned.
    longitudinal, lateral = {0: (hips[:, 1], -hips[:, 0]), 1: (hips[:, 0], hips[:, 1]), 2: (hips[:, 0], -hips[:, 2])}[
        int(np.abs(data.xaxis[thighs]).sum(axis=0).argmax())
    ]
    front = np.argsort(-longitudinal, kind="stable")
    order = [k for pair in (front[:2], front[2:]) for k in sorted(pair, key=lambda k: -lateral[k])]
    legs = [chains[k] for k in order]
    feet, centres = zip(*(_find_foot(mujoco, model, data, leg) for leg in legs), strict=True)
    require_frame(data.xanchor[[leg[1] for leg in legs]], feet)
    homes = [_find_home(model, data, leg, centre) for leg, centre in zip(legs, centres, strict=True)]
    joints = [[model.joint(k).name for k in leg] for leg in legs]
    has_names = all((*itertools.chain(*joints), *feet))
    require(has_names, "machine.path", path, "has joints or feet without a name: name them in the model")
    return Names(joints, list(feet), homes[0] if homes.count(homes[0]) == LEGS else homes)


def _find_foot(mujoco: Any, model: Any, data: Any, leg: list[int]) -> tuple[str, Array]:
    """Find name and centre (3,), m, of the foot: fixed to the calf, farthest from the knee, spheres first."""
    calf = int(model.jnt_bodyid[leg[-1]])
    knee = data.xanchor[leg[-1]]
    fixed = [k for k in range(model.nbody) if model.body_weldid[k] == calf]
    geoms = np.flatnonzero((model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE) & np.isin(model.geom_bodyid, fixed))
    if len(geoms):
        away = np.linalg.norm(data.geom_xpos[geoms] - knee, axis=1)
        named = [bool(model.geom(k).name) for k in geoms]
        foot = geoms[max(range(len(geoms)), key=lambda k: (away[k] > NEAR * away.max(), named[k], away[k]))]
        return model.geom(foot).name or model.body(model.geom_bodyid[foot]).name, data.geom_xpos[foot].copy()
    body = max(fixed, key=lambda k: float(np.linalg.norm(data.xpos[k] - knee)))
    shapes = np.flatnonzero(model.geom_bodyid == body)
    points = data.geom_xpos[shapes] if body == calf and len(shapes) else data.xpos[[body]]
    return model.body(body).name, points[np.argmax(np.linalg.norm(points - knee, axis=1))].copy()


def _find_home(model: Any, data: Any, leg: list[int], foot: Array) -> list[float]:
    """Find joint angles within their ranges that put the foot below the thigh joint, with the knee back if possible.

    Raises BadInput if there are none.
    """
    points = data.xanchor[leg]
    chain = make_chains(np.concatenate([points, data.xaxis[leg]], axis=1), foot, points[1])
    length = np.linalg.norm(points[2] - points[1]) + np.linalg.norm(foot - points[2])
    below = np.array([[0.0, HEIGHT_OF_LINKS * length, 0.0]])
    limited = model.jnt_limited[leg].astype(bool)[:, None]
    least, largest = np.where(limited, model.jnt_range[leg], [-np.pi, np.pi]).T
    solutions = [chain_angles(chain, below, np.array(start))[0] for start in STARTS]
    fitting = [q for q in solutions if np.isfinite(q).all() and (least <= q).all() and (q <= largest).all()]
    reason = "has no angle within its range at which the foot is below the hip: give machine.home"
    require(fitting, "machine.joints", model.joint(leg[-1]).name, reason)
    best = min(fitting, key=lambda q: (abs(q[0]) > 1.0, chain_points(chain, q)[2, 0] > 0.0, abs(q[0])))
    return [float(round(angle, DIGITS)) + 0.0 for angle in best]
