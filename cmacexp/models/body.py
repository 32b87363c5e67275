"""A quasi-static body on legs: height, pitch and roll balance the weight and both moments.

Body frame: origin at the centre of gravity, in the plane of the hips; x forward, y left, z up. World: the same
turned by roll, then pitch; pitch positive nose down, roll positive right side down. With foot i at (X, Y, -y) in the
body frame its depth below the undepressed ground is

    depth = -h + X sin(pitch) - Y sin(roll) cos(pitch) + y cos(roll) cos(pitch),

and its lever arms are the derivatives of that: tilt carries the centre of gravity over the feet. Balance is where the
energy W h + sum K_n depth^2 / 2 (over feet that press) is least. Where the ground begins to press a foot at a
depth ``ground_offset`` other than 0, depth - ground_offset replaces it.
"""

import math
from typing import NamedTuple

from cmacexp.jit.compiler import called_kernel, kernel
from cmacexp.models.ground import contact_force
from cmacexp.models.sine import sine_cosine
from cmacexp.typing import Array

MOST_ITERATIONS = 100
MOST_HALVINGS = 40
TOLERANCE = 1e-12
"""Largest residual force, over the weight, at which the body is in balance; for moments, N m, the same number per
metre."""
DEPTH_ROUNDING = 1e-15
"""Rounding error of a depth, m: on stiff ground it causes a residual force that no iteration removes."""
ROUNDING = 1e-13
"""Largest relative increase of the energy that counts as rounding error."""
LONGEST_STEP = 0.02
"""Largest change of height (m), pitch or roll (rad) in one iteration."""
CLOSING = 0.5
"""While each iteration reduces the residual to this fraction or less, full Newton steps are taken without checking
the energy."""
STEEPEST = 1.4
"""Pitch or roll beyond which a body has no equilibrium, rad."""


class Load(NamedTuple):
    """A weight, N, and where it acts in the plane of the hips, forward and left of the body's centre, m."""

    weight: float
    x: float
    y: float


class Pose(NamedTuple):
    """Height of a body, m, and sines and cosines of its pitch and roll."""

    height: float
    sp: float
    cp: float
    sr: float
    cr: float


LEVEL = Pose(0.0, 0.0, 1.0, 0.0, 1.0)


@kernel
def make_pose(body: Array) -> Pose:
    """Return the pose of a body at ``body`` (3,): height (m), pitch and roll (rad)."""
    sp, cp = sine_cosine(body[1])
    sr, cr = sine_cosine(body[2])
    return Pose(body[0], sp, cp, sr, cr)


@kernel
def depth(pose: Pose, x: float, y: float, down: float) -> float:
    """Return the depth below the undepressed ground, m, of the point (x, y, -down), m, of a body."""
    height, sp, cp, sr, cr = pose
    return -height + x * sp + (down * cr - y * sr) * cp


@kernel
def depth_rate(pose: Pose, rate: Array, x: float, y: float) -> float:
    """Return the downward speed, m/s, of the point (x, y, 0), m, of a body with ``rate`` (3,), m/s and rad/s."""
    _, sp, cp, sr, cr = pose
    return -rate[0] + (x * cp + y * sr * sp) * rate[1] - y * cr * cp * rate[2]


@kernel
def energy(body: Array, hips: Array, foot: Array, stiffness: Array, ground_offset: Array, load: Load) -> float:
    """Compute the energy, J, of the weight and of the pressed ground with the body at ``body`` (3,), m and rad.

    The other arguments are those of :func:`balance`.
    """
    pose = make_pose(body)
    total = -load.weight * depth(pose, load.x, load.y, 0.0)
    for i in range(hips.shape[0]):
        pressed = max(0.0, depth(pose, hips[i, 0] + foot[i, 0], hips[i, 1], foot[i, 1]) - ground_offset[i])
        total += 0.5 * stiffness[i] * pressed * pressed
    return total


class Slope(NamedTuple):
    """Gradient and curvature of the energy with respect to height h, pitch p and roll r."""

    h: float
    p: float
    r: float
    hh: float
    hp: float
    hr: float
    pp: float
    pr: float
    rr: float


@kernel
def slope(
    body: Array, hips: Array, foot: Array, stiffness: Array, ground_offset: Array, load: Load, force: Array
) -> Slope:
    """Compute gradient (N and N m) and curvature of the energy; fill the contact forces ``force`` (L,), N.

    The other arguments are those of :func:`balance`.
    """
    height, sp, cp, sr, cr = make_pose(body)
    longitudinal = load.weight * load.x
    lateral = load.weight * load.y
    tilt = load.weight * load.y * sr
    h = load.weight
    p = -(longitudinal * cp + tilt * sp)
    r = lateral * cr * cp
    hh = hp = hr = 0.0
    pp = longitudinal * sp - tilt * cp
    pr = -lateral * cr * sp
    rr = -tilt * cp
    for i in range(hips.shape[0]):
        x = hips[i, 0] + foot[i, 0]
        y = hips[i, 1]
        down = foot[i, 1]
        below = x * sp + (down * cr - y * sr) * cp
        k = stiffness[i]
        f = contact_force(k, below - height - ground_offset[i])
        force[i] = f
        if f > 0.0:
            along = x * cp - (down * cr - y * sr) * sp
            across = -(y * cr + down * sr) * cp
            h -= f
            p += f * along
            r += f * across
            hh += k
            hp -= k * along
            hr -= k * across
            pp += k * along * along - f * below
            pr += k * along * across + f * (y * cr + down * sr) * sp
            rr += k * across * across + f * (y * sr - down * cr) * cp
    return Slope(h=h, p=p, r=r, hh=hh, hp=hp, hr=hr, pp=pp, pr=pr, rr=rr)


@kernel
def newton_step(at: Slope, damping: float) -> tuple[bool, float, float, float]:
    """Solve the damped Newton equations for a step in height (m), pitch and roll (rad).

    Return True and the step if the damped curvature is positive definite, else False and zeros.
    """
    a = at.hh + damping
    b = at.hp
    c = at.hr
    d = at.pp + damping
    e = at.pr
    f = at.rr + damping
    minor = a * d - b * b
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    if not (a > 0.0 and minor > 0.0 and determinant > 0.0):
        return False, 0.0, 0.0, 0.0
    g = -at.h
    p = -at.p
    r = -at.r
    return (
        True,
        (g * (d * f - e * e) - b * (p * f - e * r) + c * (p * e - d * r)) / determinant,
        (a * (p * f - e * r) - g * (b * f - c * e) + c * (b * r - c * p)) / determinant,
        (a * (d * r - p * e) - b * (b * r - c * p) + g * (b * e - c * d)) / determinant,
    )


@kernel
def descend(
    body: Array,
    hips: Array,
    foot: Array,
    stiffness: Array,
    ground_offset: Array,
    load: Load,
    step: tuple[float, float, float],
) -> bool:
    """Take a ``step`` (m, rad, rad) of ``body`` (3,), shortened until the energy does not increase.

    Return False, with ``body`` unchanged, if the energy always increases. The other arguments are those of
    :func:`balance`.

    On two feet the energy is almost flat along one tilt: an unbounded step would roll the body over.
    """
    h, p, r = body[0], body[1], body[2]
    dh, dp, dr = step
    before = energy(body, hips, foot, stiffness, ground_offset, load)
    scale = min(1.0, LONGEST_STEP / max(abs(dh), abs(dp), abs(dr)))
    for _ in range(MOST_HALVINGS):
        body[0], body[1], body[2] = h + scale * dh, p + scale * dp, r + scale * dr
        if energy(body, hips, foot, stiffness, ground_offset, load) <= before + ROUNDING * abs(before):
            return True
        scale *= 0.5
    body[0], body[1], body[2] = h, p, r
    return False


@called_kernel
def balance(
    hips: Array, foot: Array, stiffness: Array, ground_offset: Array, load: Load, body: Array, force: Array
) -> bool:
    """Find the height (m), pitch and roll (rad) at which the feet carry the body; return False if there are none.

    ``hips`` (L, 2) are in the body frame, ``foot`` (L, 2) in those of the hips, m; ``stiffness`` (L,) is K_n under
    each foot, N/m, ``ground_offset`` (L,) the depth at which the ground begins to press it, m; ``load`` has the
    weight. The search starts at ``body`` (3,), which becomes the equilibrium, and fills ``force`` (L,), N.
    """
    enough = TOLERANCE * load.weight
    for i in range(stiffness.shape[0]):
        enough += DEPTH_ROUNDING * stiffness[i]
    closing = True
    last = math.inf
    for _ in range(MOST_ITERATIONS):
        at = slope(body, hips, foot, stiffness, ground_offset, load, force)
        out = max(abs(at.h), abs(at.p), abs(at.r))
        if out <= enough:
            return True
        if not (math.isfinite(out) and abs(body[1]) < STEEPEST and abs(body[2]) < STEEPEST):
            return False
        closing = closing and out <= CLOSING * last
        last = out
        convex, dh, dp, dr = newton_step(at, 0.0)
        if closing and convex and max(abs(dh), abs(dp), abs(dr)) <= LONGEST_STEP:
            body[0] += dh
            body[1] += dp
            body[2] += dr
            continue
        damping = load.weight
        while not convex:
            convex, dh, dp, dr = newton_step(at, damping)
            damping = 10.0 * damping + load.weight
        if not descend(body, hips, foot, stiffness, ground_offset, load, (dh, dp, dr)):
            return False
    return False
