"""Distribution of the weight over the supporting feet."""

import numpy as np

from cmacexp.typing import Array, Mask

LEAST_FRACTION = 1e-9
"""Least load fraction in the cost of a solution, for a foot that balance requires although its fraction is 0."""
ROUNDING = 1e-9
"""Largest negative force, over the weight, that counts as rounding."""
DEPENDENT = 1e-9
"""Remainder of a condition, over its size, below which the condition follows from the others and the rest is
rounding."""


def _dot(a: Array, b: Array) -> Array:
    """Compute scalar products (N,) of rows (N, L), summed in the order of the feet: same bits on every processor."""
    total = np.zeros(len(a))
    for i in range(a.shape[1]):
        total = total + a[:, i] * b[:, i]
    return total


def _solve(weight: Array, feet: Array, load_fraction: Array) -> Array:
    """Compute forces (N, L) that balance weight (N,) and both moments with the least sum of F^2 / load_fraction.

    The three conditions are made orthogonal one after the other (Gram-Schmidt, twice against rounding). One that
    follows from those before it, as with two feet, is left out. All of it is elementary arithmetic: numpy's
    pseudo-inverse gives other bits with another version or processor.
    """
    root = np.sqrt(load_fraction)
    directions: list[Array] = []
    components: list[Array] = []
    for row, wanted in ((root, weight), (root * feet[..., 0], 0.0), (root * feet[..., 1], 0.0)):
        rest = row
        missing = wanted + np.zeros_like(weight)
        for _ in range(2):
            for direction, component in zip(directions, components, strict=True):
                share = _dot(rest, direction)
                rest = rest - share[:, None] * direction
                missing = missing - share * component
        length = np.sqrt(_dot(rest, rest))
        counts = length > DEPENDENT * np.sqrt(_dot(row, row))
        length = np.where(counts, length, 1.0)
        directions.append(np.where(counts[:, None], rest / length[:, None], 0.0))
        components.append(np.where(counts, missing / length, 0.0))
    force = np.zeros_like(load_fraction)
    for direction, component in zip(directions, components, strict=True):
        force = force + root * direction * component[:, None]
    return force


def _solve_without_one(weight: Array, feet: Array, support: Mask, load_fraction: Array) -> tuple[Array, Array]:
    """Compute the best forces (N, L) that leave one foot out and pull with none, and their cost (N,).

    The cost is the sum of F^2 / load_fraction, infinite where every choice pulls. Three feet have one solution,
    whatever their load fractions.
    """
    best = np.zeros_like(load_fraction)
    least = np.full(len(load_fraction), np.inf)
    for left_out in range(load_fraction.shape[1]):
        used = support & (np.arange(load_fraction.shape[1]) != left_out)
        force = _solve(weight, feet, used.astype(float))
        cost = np.where(used, force**2 / np.maximum(load_fraction, LEAST_FRACTION), 0.0).sum(axis=1)
        fits = (force >= -ROUNDING * weight[:, None]).all(axis=1) & (used.sum(axis=1) >= 3) & (cost < least)
        best[fits] = force[fits]
        least[fits] = cost[fits]
    return best, least


def share_load(weight: float | Array, feet: Array, support: Mask, load_fraction: Array) -> Array:
    """Compute upward forces (N, L), N, of feet that balance ``weight``, N, and both of its moments.

    ``weight`` is a number or (N,). With four feet down the sum of F^2/load_fraction is least; a foot of
    ``load_fraction`` (N, L), 0 to 1, of 0 counts as lifted, so that two of them can leave a moment. With three or
    fewer down, fractions are ignored; the weight is balanced first, then the moment about the body's y, then that
    about its x. If a foot would pull, the best three that press replace the solution; if there are none, with the
    weight outside the feet, it stays and pulls (see :func:`remove_pull`). ``feet`` (N, L, 2) are in the horizontal
    plane, relative to the line of action of the weight, m; ``support`` (N, L) is true for feet that are down.
    """
    weight = np.broadcast_to(np.asarray(weight, dtype=float), len(feet))
    few = support.sum(axis=1, keepdims=True) <= 3
    load_fraction = np.where(few, 1.0, load_fraction)
    force = _solve(weight, feet, np.where(support, load_fraction, 0.0))
    pulls = (force < -ROUNDING * weight[:, None]).any(axis=1)
    if pulls.any():
        best, cost = _solve_without_one(weight[pulls], feet[pulls], support[pulls], load_fraction[pulls])
        force[pulls] = np.where(np.isfinite(cost)[:, None], best, force[pulls])
    return force


def remove_pull(force: Array) -> Array:
    """Replace negative forces (N, L) by zero, and scale the others so that the sum stays the same.

    The moments are then out of balance by the force that is left out, while the load lies outside the feet.
    """
    pressing = np.maximum(force, 0.0)
    scaled: Array = pressing * (force.sum(axis=1) / pressing.sum(axis=1))[:, None]
    return np.where((force < 0.0).any(axis=1, keepdims=True), scaled, force)
