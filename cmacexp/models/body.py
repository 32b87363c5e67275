"""A quasi-static body on legs: height, pitch and roll balance the weight and both moments.

Body frame: origin at the centre of gravity, in the plane of the hips; x forward, y left, z up. World: the same
turned by roll, then pitch; pitch positive nose down, roll positive right side down. With foot i at (X, Y, -y) in the
body frame its depth below the undepressed ground is

    depth = -h + X sin(pitch) - Y sin(roll) cos(pitch) + y cos(roll) cos(pitch),

and its lever arms are the derivatives of that: tilt carries the centre of gravity over the feet. Balance is where the
energy W h + sum K_n depth^2 / 2 (over feet that press) is least.
"""

import math

from cmacexp.arrays import Array
from cmacexp.compile import kernel, kernel_apart
from cmacexp.models.ground import contact_force
from cmacexp.models.sine import sine_cosine

MOST_ITERATIONS = 100
MOST_HALVINGS = 40
TOLERANCE = 1e-12
"""Largest force out of balance over the weight; moments likewise, per metre."""
DEPTH_ROUNDING = 1e-15
"""Rounding of a depth, m: stiff ground makes a force of it that cannot be balanced."""
ROUNDING = 1e-13
"""A rise of the energy by so much of itself is rounding."""
LONGEST_STEP = 0.02
"""Largest change of height (m), pitch or roll (rad) in one iteration."""
STEEPEST = 1.4
"""A body tilted further has no balance, rad."""


@kernel
def depth(body: Array, x: float, y: float, down: float) -> float:
    """Depth below the undepressed ground, m, of the point (x, y, -down) in the body frame."""
    sp, cp = sine_cosine(body[1])
    sr, cr = sine_cosine(body[2])
    return -body[0] + x * sp + (down * cr - y * sr) * cp


@kernel
def energy(body: Array, hips: Array, foot: Array, stiffness: Array, weight: float) -> float:
    """Energy of weight and pressed ground, J."""
    total = weight * body[0]
    for i in range(hips.shape[0]):
        pressed = max(0.0, depth(body, hips[i, 0] + foot[i, 0], hips[i, 1], foot[i, 1]))
        total += 0.5 * stiffness[i] * pressed * pressed
    return total


@kernel
def slope(body: Array, hips: Array, foot: Array, stiffness: Array, weight: float, force: Array, work: Array) -> None:
    """Gradient and curvature of the energy; fills ``force`` (L,) and ``work``.

    ``work[:3]`` becomes the gradient by height, pitch and roll, ``work[3:9]`` the curvature: hh, hp, hr, pp, pr, rr.
    """
    sp, cp = sine_cosine(body[1])
    sr, cr = sine_cosine(body[2])
    for n in range(9):
        work[n] = 0.0
    work[0] = weight
    for i in range(hips.shape[0]):
        x, y, down = hips[i, 0] + foot[i, 0], hips[i, 1], foot[i, 1]
        below = x * sp + (down * cr - y * sr) * cp
        force[i] = contact_force(stiffness[i], below - body[0])
        if force[i] > 0.0:
            along = x * cp - (down * cr - y * sr) * sp
            across = -(y * cr + down * sr) * cp
            k, f = stiffness[i], force[i]
            work[0] -= f
            work[1] += f * along
            work[2] += f * across
            work[3] += k
            work[4] -= k * along
            work[5] -= k * across
            work[6] += k * along * along - f * below
            work[7] += k * along * across + f * (y * cr + down * sr) * sp
            work[8] += k * across * across + f * (y * sr - down * cr) * cp


@kernel
def newton_step(work: Array, damping: float) -> bool:
    """Solve the damped Newton equations of ``work``; ``work[9:12]`` becomes the step.

    Returns:
        False if the damped curvature is not positive definite.
    """
    a, b, c = work[3] + damping, work[4], work[5]
    d, e, f = work[6] + damping, work[7], work[8] + damping
    minor = a * d - b * b
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    if not (a > 0.0 and minor > 0.0 and determinant > 0.0):
        return False
    g, p, r = -work[0], -work[1], -work[2]
    work[9] = (g * (d * f - e * e) - b * (p * f - e * r) + c * (p * e - d * r)) / determinant
    work[10] = (a * (p * f - e * r) - g * (b * f - c * e) + c * (b * r - c * p)) / determinant
    work[11] = (a * (d * r - p * e) - b * (b * r - c * p) + g * (b * e - c * d)) / determinant
    return True


@kernel
def descend(body: Array, hips: Array, foot: Array, stiffness: Array, weight: float, work: Array) -> bool:
    """Go along the step in ``work[9:12]``, shortened until the energy does not rise; False if it always does.

    On two feet the energy is almost flat along one tilt: an unbounded step would roll the body over.
    """
    h, p, r = body[0], body[1], body[2]
    before = energy(body, hips, foot, stiffness, weight)
    scale = min(1.0, LONGEST_STEP / max(abs(work[9]), abs(work[10]), abs(work[11])))
    for _ in range(MOST_HALVINGS):
        body[0], body[1], body[2] = h + scale * work[9], p + scale * work[10], r + scale * work[11]
        if energy(body, hips, foot, stiffness, weight) <= before + ROUNDING * abs(before):
            return True
        scale *= 0.5
    body[0], body[1], body[2] = h, p, r
    return False


@kernel_apart
def balance(
    hips: Array, foot: Array, stiffness: Array, weight: float, body: Array, force: Array, work: Array
) -> bool:
    """Find the height, pitch and roll at which the feet carry the body.

    Args:
        hips: (L, 2): hips in the body frame, m.
        foot: (L, 2): feet in the frames of their hips, m.
        stiffness: (L,): K_n under each foot, N/m.
        weight: W, N.
        body: (3,): height (m), pitch and roll (rad), from where the search starts; becomes the balance.
        force: (L,): is filled with the contact forces, N.
        work: (12,): room.

    Returns:
        False if there is no balance; ``body`` and ``force`` are then of no use.
    """
    enough = TOLERANCE * weight
    for i in range(stiffness.shape[0]):
        enough += DEPTH_ROUNDING * stiffness[i]
    for _ in range(MOST_ITERATIONS):
        slope(body, hips, foot, stiffness, weight, force, work)
        out = max(abs(work[0]), abs(work[1]), abs(work[2]))
        if out <= enough:
            return True
        if not (math.isfinite(out) and abs(body[1]) < STEEPEST and abs(body[2]) < STEEPEST):
            return False
        damping = 0.0
        while not newton_step(work, damping):
            damping = 10.0 * damping + weight
        if not descend(body, hips, foot, stiffness, weight, work):
            return False
    return False
