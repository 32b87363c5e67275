"""Repeated images of one vector under a linear map, and the leading eigenvalues of the map (Arnoldi 1951)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.typing import Array

# Products are taken by einsum, not by BLAS, whose threads cost more than they save at this size where cores are busy.
EXHAUSTED = 1e-10
"""A new direction shorter than this, relative to the last, adds no direction."""


class Krylov(NamedTuple):
    """A linear map on the space of a vector and its first images; m is the dimension of that space."""

    hessenberg: Array
    """(m, m): the map in the orthonormal basis of that space."""
    start: float
    """Length of the vector."""
    observations: Array
    """(m, p): of the map at each vector of the basis."""

    def eigenvalues(self) -> NDArray[np.complex128]:
        """Ritz values (m,), the largest first: the outer ones are near eigenvalues of the map."""
        values = np.linalg.eigvals(self.hessenberg).astype(np.complex128)
        return values[np.argsort(-np.abs(values))]

    def lengths(self, times: int) -> Array:
        """Lengths of the observations at the vector and its first images, (times,); exact for the first m of them."""
        each, weights = self.observations, np.zeros((times, len(self.hessenberg)))
        weights[0, 0] = self.start  # the vector and its images in the basis
        with np.errstate(over="ignore", invalid="ignore"):  # what grows without end is not finite
            for k in range(1, times):
                weights[k] = np.einsum("ij,j", self.hessenberg, weights[k - 1])
            squares = np.einsum("ti,ij,tj->t", weights, np.einsum("ip,jp", each, each), weights, optimize=True)
        return np.sqrt(np.where(np.isnan(squares), np.inf, np.maximum(squares, 0.0)))


def krylov(apply: Callable[[Array], tuple[Array, Array]], start: Array, dimension: int) -> Krylov:
    """Reduce a linear map to the space of ``start`` (n,), not zero, and its first images.

    ``apply`` takes a vector (n,) and returns its image (n,) and an observation (p,). The space has a lower
    ``dimension`` if the images span fewer directions.
    """
    dimension = min(dimension, len(start))
    basis = np.empty((dimension + 1, len(start)))
    hessenberg, observations = np.zeros((dimension + 1, dimension)), []
    length = float(np.linalg.norm(start))
    basis[0] = start / length
    for k in range(dimension):
        image, observation = apply(basis[k])
        observations.append(observation)
        size = float(np.linalg.norm(image))
        for _ in range(2):  # once leaves them orthogonal to no more than a few digits
            parts = np.einsum("ij,j", basis[: k + 1], image)
            image = image - np.einsum("i,ij", parts, basis[: k + 1])
            hessenberg[: k + 1, k] += parts
        rest = float(np.linalg.norm(image))
        if rest <= EXHAUSTED * size:
            return Krylov(hessenberg[: k + 1, : k + 1], length, np.array(observations))
        hessenberg[k + 1, k] = rest
        basis[k + 1] = image / rest
    return Krylov(hessenberg[:dimension], length, np.array(observations))
