"""Search for the legs of a model by the tree of its bodies: joints, feet, direction, and a home with bent knees.

Four legs are chains of as many joints each, of which the first three are hinges. All other joints must be held.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cmacexp.errors import BadInput, require
from cmacexp.jit.compiler import workload
from cmacexp.models.chain import chain_angles, chain_points, find_lateral, make_chains
from cmacexp.models.robot import load_model, load_mujoco, set_posture
from cmacexp.models.robot_gains import HEIGHT_OF_LINKS
from cmacexp.models.robot_legs import (
    JOINTS,
    LEAST_COSINE,
    LEGS,
    find_chain,
    find_foot,
    find_free,
    find_joint,
    require_feet,
    require_frame,
    require_hanging,
    require_joints,
)
from cmacexp.typing import Array

USUAL_HOME = (0.0, 0.9, -1.8)
"""Joint angles of a leg, rad, that are home if all four legs can stand near them."""
NEAR_HOME = 1.0
"""Largest distance of a joint from them, rad; of the robots of the package it is up to 0.26."""
STARTS = tuple(itertools.product((0.9, -0.9, 0.0), (-1.8, 1.8, -0.9, 0.9)))
"""Angles of thigh and calf, rad, from which a home is searched; the first of equally good results counts."""
DIGITS = 2
"""Decimals of a home angle, rad."""
NEAR = 0.8
"""Distance from the knee, over that of the farthest sphere, above which a sphere with a name is taken as the foot."""
LEVEL = 1e-6
"""Largest amplitude of the height of a thigh's axis, a unit vector, that the hip does not change."""


class Names(NamedTuple):
    """Values of ``machine.joints``, ``machine.feet`` and ``machine.home`` for a model."""

    joints: list[list[str]]
    feet: list[str]
    home: list[Any]


def find_names(
    path: Path,
    weld: Sequence[str] = (),
    yaw: float = 0.0,
    joints: Sequence[Sequence[str | int]] = (),
    feet: Sequence[str | int] = (),
    home: Sequence[Any] = (),
) -> Names:
    """Find joints, feet and home of a model, with the legs front left, front right, rear left, rear right.

    ``weld`` are joints that are held; ``yaw`` is the angle from the x axis of the trunk to forward, rad. What is
    given of ``joints``, ``feet`` and ``home`` is not searched. Raises BadInput if the file is no model, has no four
    chains of three hinges, has further joints, or is turned.
    """
    given = _to_names(joints), tuple(map(str, feet))
    names = _find_names(path, path.stat().st_mtime_ns, tuple(weld), yaw, *given, not home)
    return names._replace(home=list(home)) if home else names


def find_yaw(path: Path, weld: Sequence[str] = (), joints: Sequence[Sequence[str | int]] = ()) -> float:
    """Find the angle from the x axis of the trunk to forward, rad; 0 if they are nearly the same.

    Forward is normal to the axes of the thighs. The order of ``joints`` says at which end the front is; if it is not
    given, the names of the hips do, if only two of them have the letter ``f``, as in FL and front_left. Otherwise it
    is on the side of the x axis or, at right angles to it, of the y axis. Where front legs stand beside each other
    along these axes, as where hips pitch before they roll, forward is from the rear to the front legs. Raises
    BadInput as :func:`find_names`.
    """
    return _find_yaw(path, path.stat().st_mtime_ns, tuple(weld), _to_names(joints))


def _to_names(joints: Sequence[Sequence[str | int]]) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(map(str, leg)) for leg in joints)


@lru_cache(maxsize=16)
def _find_names(
    path: Path,
    changed: int,
    weld: tuple[str, ...],
    yaw: float,
    given_joints: tuple[tuple[str, ...], ...],
    given_feet: tuple[str, ...],
    needs_home: bool,
) -> Names:
    """Find the names of a model; ``changed``, its time of modification in ns, is part of the key of the cache."""
    mujoco = load_mujoco()
    model, data, chains = _find_legs(path, weld, yaw, given_joints)
    legs = chains if given_joints else _sort_legs(model, data, chains)
    if given_feet:
        require_feet(given_feet)
        ends = [_find_given_foot(mujoco, model, data, *each) for each in zip(legs, given_feet, strict=True)]
    else:
        ends = [_find_foot(mujoco, model, data, leg) for leg in legs]
    feet, centres = zip(*ends, strict=True)
    require_frame(data.xanchor[[leg[1] for leg in legs]], feet, yaw)
    joints = [[model.joint(k).name for k in leg] for leg in legs]
    has_names = all((*itertools.chain(*joints), *feet))
    require(has_names, "machine.path", path, "has joints or feet without a name: name them in the model")
    with workload(LEGS):
        return Names(joints, list(feet), _find_homes(model, data, legs, centres) if needs_home else [])


def _sort_legs(model: Any, data: Any, legs: list[list[int]]) -> list[list[int]]:
    """Sort legs by their places: front left, front right, rear left, rear right."""
    thighs = [leg[1] for leg in legs]
    hips = data.xanchor[thighs]
    # Thighs turn about the lateral axis; if that is not y, the frame of the trunk is turned, which is refused later,
    # unless names say that the front legs are those along x: there hips pitch before they roll.
    axis = int(np.abs(data.xaxis[thighs]).sum(axis=0).argmax())
    if axis == 0 and _find_front(model, legs) == {*np.argsort(-hips[:, 0])[: LEGS // 2].tolist()}:
        axis = 1
    longitudinal, lateral = ((hips[:, 1], -hips[:, 0]), (hips[:, 0], hips[:, 1]), (hips[:, 0], -hips[:, 2]))[axis]
    front = np.argsort(-longitudinal, kind="stable")
    return [legs[k] for pair in (front[:2], front[2:]) for k in sorted(pair, key=lambda k: -lateral[k])]


@lru_cache(maxsize=16)
def _find_yaw(path: Path, changed: int, weld: tuple[str, ...], joints: tuple[tuple[str, ...], ...]) -> float:
    """Find the yaw of a model; ``changed`` is as for :func:`_find_names`."""
    model, data, chains = _find_legs(path, weld, 0.0, joints)
    thighs = [chain[1] for chain in chains]
    axes = data.xaxis[thighs]
    lateral = (axes * np.sign(axes @ axes[0])[:, None]).mean(axis=0)
    length = math.hypot(lateral[0], lateral[1])
    if length < LEAST_COSINE:  # the trunk lies on its side, which require_frame refuses
        return 0.0
    forward = np.array([lateral[1], -lateral[0]]) / length
    hips = data.xanchor[thighs, :2]
    front = {*np.argsort(-(hips @ forward))[: LEGS // 2].tolist()}
    named = {0, 1} if joints else _find_front(model, chains)
    is_named = np.isin(range(LEGS), [*named])
    toward = hips[is_named].sum(axis=0) - hips[~is_named].sum(axis=0)
    if named in (front, {*range(LEGS)} - front):
        sign = 1.0 if named == front else -1.0
    elif len(named) == LEGS // 2 and (hips @ toward)[is_named].min() > (hips @ toward)[~is_named].max():
        sign, forward = 1.0, toward / np.linalg.norm(toward)
    else:
        sign = float(np.sign(forward[0] if abs(forward[0]) > 1.0 - LEAST_COSINE else forward[1]))
    x, y = sign * forward
    return 0.0 if x >= LEAST_COSINE else math.atan2(y, x)


def _find_legs(
    path: Path, weld: Sequence[str], yaw: float, joints: tuple[tuple[str, ...], ...]
) -> tuple[Any, Any, list[list[int]]]:
    """Load a model and find its legs; return it, its data at zero joint angles, and the joints of each leg.

    If the names of their ``joints`` are given, those are taken. Raises BadInput as :func:`find_names`.
    """
    mujoco = load_mujoco()
    model = load_model(path, weld, yaw).model
    if joints:
        require_joints(joints)
        chains = [[find_joint(mujoco, model, name) for name in leg] for leg in joints]
    else:
        chains = _find_chains(mujoco, path, model, weld)
    find_free(mujoco, model, path, np.array(chains))
    return model, set_posture(model, mujoco.MjData(model), np.array(chains), np.zeros(JOINTS)), chains


def _find_front(model: Any, legs: list[list[int]]) -> set[int]:
    """Find the legs whose name of the hip joint says that they are in front; all or none say nothing."""
    sides = [re.sub("left|right", "", model.joint(leg[0]).name.lower()) for leg in legs]
    shared = set.intersection(*map(set, sides))
    return {k for k, side in enumerate(sides) if "f" in {*side} - shared}


def _find_chains(mujoco: Any, path: Path, model: Any, weld: Sequence[str]) -> list[list[int]]:
    """Find the joints of the four legs, three each, from the trunk outwards.

    Raises BadInput if there are no such legs, or if other joints move.
    """
    free, hinge = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_HINGE)
    kinds = model.jnt_type.tolist()
    body_chains = [find_chain(model, body) for body in sorted(set(model.jnt_bodyid.tolist()))]
    inner = {k for chain in body_chains for k in chain[:-1]}
    ends = [[k for k in chain if kinds[k] != free] for chain in body_chains if chain[-1] not in inner]
    times = Counter(itertools.chain(*ends))
    chains = [chain for chain in ([k for k in end if times[k] == 1] for end in ends) if chain]
    legs = [chain for chain in chains if [kinds[k] for k in chain[:JOINTS]] == [hinge] * JOINTS]
    by_length = Counter(map(len, legs))
    if len(legs) != LEGS:
        legs = [chain for chain in legs if by_length[len(chain)] == LEGS]
    if len(legs) != LEGS:
        found = "; ".join(" > ".join(_describe(mujoco, model, k) for k in chain) for chain in chains[: 2 * LEGS])
        allowed = "must have four legs, chains of three hinges each from the trunk outwards"
        raise BadInput("machine.path", path, f"{allowed}; its chains of joints are {found or 'none'}")
    _require_three_joints(mujoco, path, model, legs)
    legs = [chain[:JOINTS] for chain in legs]
    moving = sorted({k for k, kind in enumerate(kinds) if kind != free} - {*itertools.chain(*legs)})
    names = [model.joint(k).name for k in moving]
    cure = f"hold them by machine.weld=[{','.join([*weld, *names])}]"
    if not all(names):
        listed = ", ".join(_describe(mujoco, model, k) for k in moving)
        cure = f"{listed}: name them to hold them by machine.weld, or use <freejoint/> for a trunk that moves"
    require(not moving, "machine.path", path, f"has joints besides the three of each leg: {cure}")
    return legs


def _require_three_joints(mujoco: Any, path: Path, model: Any, legs: list[list[int]]) -> None:
    """Require that joints beyond the third of a leg are clearly none of its own, but wheels or springs.

    A leg may have an ankle, or a joint for the backlash of each of its joints. Raises BadInput with all joints.
    """
    turns = ~model.jnt_limited.astype(bool) | (np.ptp(model.jnt_range, axis=1) >= math.tau)
    is_own = ~turns & (model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    found = "; ".join(" > ".join(_describe(mujoco, model, k) for k in leg) for leg in legs)
    advice = "hold those besides hip, thigh and calf of each leg by machine.weld"
    if len({*map(len, legs)}) > 1:
        advice = "it is no quadruped, whose legs have equally many"
    allowed = f"must have three joints in each leg; its chains of joints are {found}: {advice}"
    require(not any(is_own[k] for leg in legs for k in leg[JOINTS:]), "machine.path", path, allowed)


def _describe(mujoco: Any, model: Any, joint: int) -> str:
    """Return the name of a joint, with its kind if it is no hinge."""
    name = model.joint(joint).name or f"joint {joint}"
    kind = mujoco.mjtJoint(int(model.jnt_type[joint]))
    return name if kind == mujoco.mjtJoint.mjJNT_HINGE else f"{name} (a {kind.name[len('mjJNT_') :].lower()})"


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
    away = np.linalg.norm(points - knee, axis=1)
    allowed = "must have a geometry, a site or a fixed body at its end, which is the foot"
    require(away.max() > 0.0, "machine.feet", model.body(calf).name, allowed)
    return model.body(body).name, points[np.argmax(away)].copy()


def _find_given_foot(mujoco: Any, model: Any, data: Any, leg: list[int], name: str) -> tuple[str, Array]:
    """Find the centre (3,), m, of the foot with this name, which must hang on the leg; return it after the name."""
    sphere = find_foot(mujoco, model, data, name)
    body, centre = sphere[:2] if sphere else (int(model.geom(name).bodyid[0]), data.geom(name).xpos.copy())
    require_hanging(model, leg, body, name)
    return name, centre


class _Leg(NamedTuple):
    """Geometry of a leg in the frame of its thigh joint, and the height at which it stands."""

    name: str
    """Name of its calf joint."""
    chain: Array
    """(21,): m, see :mod:`cmacexp.models.chain`."""
    height: float
    """Height of the thigh joint above the foot, m."""
    ranges: Array
    """(3, 2): least and largest joint angles, rad."""

    def stand(self, start: Sequence[float]) -> Array | None:
        """Find joint angles (3,), rad, from ``start``, that keep its hip angle where the leg permits it.

        None if there are none within the ranges.
        """
        home = np.array(start)
        target = np.array([[0.0, self.height, find_lateral(self.chain, home, self.height)]])
        q: Array = chain_angles(self.chain, target, home)[0]
        fits = np.isfinite(q).all() and (self.ranges[:, 0] <= q).all() and (q <= self.ranges[:, 1]).all()
        return q if fits else None

    def is_near(self, home: Sequence[float]) -> bool:
        """Return True if the leg stands near ``home`` (3,), rad; farther away it may bend another way."""
        q = self.stand(home)
        return q is not None and float(np.abs(q - home).max()) < NEAR_HOME


def _find_homes(model: Any, data: Any, legs: list[list[int]], feet: Sequence[Array]) -> list[Any]:
    """Find the home of all legs, or of each, with the plane of the leg upright and the knee back if possible.

    Raises BadInput if a leg has none.
    """
    geometries = []
    for leg, foot in zip(legs, feet, strict=True):
        points = data.xanchor[leg]
        chain = make_chains(np.concatenate([points, data.xaxis[leg]], axis=1), foot, points[1])
        length = np.linalg.norm(points[2] - points[1]) + np.linalg.norm(foot - points[2])
        limited = model.jnt_limited[leg].astype(bool)[:, None]
        ranges = np.where(limited, model.jnt_range[leg], [-np.pi, np.pi])
        geometries.append(_Leg(model.joint(leg[-1]).name, chain, float(HEIGHT_OF_LINKS * length), ranges))
    if all(leg.is_near(USUAL_HOME) for leg in geometries):
        return list(USUAL_HOME)
    homes = [_find_home(leg) for leg in geometries]
    return homes[0] if homes.count(homes[0]) == LEGS else homes


def _find_home(leg: _Leg) -> list[float]:
    """Find the home of one leg; raises BadInput if there is none."""
    starts = [(hip, *start) for hip in _find_upright(leg) for start in STARTS]
    fitting = [q for start in starts if (q := leg.stand(start)) is not None]
    reason = "has no angle within its range at which the foot is below the hip: give machine.home"
    require(fitting, "machine.joints", leg.name, reason)

    def rank(q: Array) -> tuple[bool, bool, float]:
        is_knee_ahead = bool(chain_points(leg.chain, q)[2, 0] > 0.0)  # of the foot
        return abs(q[0]) > 1.0, is_knee_ahead, round(abs(q[0]), DIGITS)

    best = min(fitting, key=rank)
    return [float(round(angle, DIGITS)) + 0.0 for angle in best]


def _find_upright(leg: _Leg) -> list[float]:
    """Find the hip angles, rad, within the range at which the axis of the thigh is level; 0 if all or none are."""
    hip, thigh = leg.chain[3:6], leg.chain[9:12]
    down = 1  # axis of the frame of a hip
    along = (hip @ thigh) * hip[down]
    cosine, sine = thigh[down] - along, np.cross(hip, thigh)[down]
    size = math.hypot(cosine, sine)
    if size < LEVEL or abs(along) > size:
        return [0.0]
    middle, half = math.atan2(sine, cosine), math.acos(-along / size)
    angles = [math.remainder(middle + sign * half, math.tau) for sign in (1.0, -1.0)]
    least, largest = leg.ranges[0]
    return [0.0 + angle for angle in sorted(angles, key=abs) if least <= angle <= largest] or [0.0]
