"""What repeating a linear map does to one vector, and the leading eigenvalues of the map (Arnoldi 1951)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.typing import Array

# Products are taken by einsum, not by BLAS, whose threads cost more than they save at this size where cores are busy.
EXHAUSTED = 1e-10
"""A new direction shorter than this, relative to the last, tells nothing new."""


class Krylov(NamedTuple):
    """A linear map seen from the space of a vector and its first images; m is the dimension of that space."""

    hessenberg: Array
    """(m, m): the map in the orthonormal basis of that space."""
    start: float
    """Length of the vector."""
    seen: Array
    """(m, p): what was seen of the map at each vector of the basis."""

    def eigenvalues(self) -> NDArray[np.complex128]:
        """Ritz values (m,), the largest first: the outer ones are near eigenvalues of the map."""
        values = np.linalg.eigvals(self.hessenberg).astype(np.complex128)
        return values[np.argsort(-np.abs(values))]

    def iterate(self, times: int) -> Array:
        """What is seen of the map at the vector and its first images, (times, p); exact for the first m of them."""
        weights = np.zeros(len(self.hessenberg))
        weights[0] = self.start
        seen = []
        for _ in range(times):
            seen.append(np.einsum("i,ij", weights, self.seen))
            weights = np.einsum("ij,j", self.hessenberg, weights)
        return np.array(seen)


def krylov(map_of: Callable[[Array], tuple[Array, Array]], start: Array, dimension: int) -> Krylov:
    """Look at a linear map from ``start`` on.

    Args:
        map_of: takes a vector (n,); gives its image (n,) and what is seen of it (p,).
        start: (n,), not zero.
        dimension: most vectors to look along; fewer where they tell nothing new.
    """
    dimension = min(dimension, len(start))
    basis = np.empty((dimension + 1, len(start)))
    hessenberg, seen = np.zeros((dimension + 1, dimension)), []
    length = float(np.linalg.norm(start))
    basis[0] = start / length
    for k in range(dimension):
        image, shown = map_of(basis[k])
        seen.append(shown)
        size = float(np.linalg.norm(image))
        for _ in range(2):  # once leaves them orthogonal to no more than a few digits
            parts = np.einsum("ij,j", basis[: k + 1], image)
            image = image - np.einsum("i,ij", parts, basis[: k + 1])
            hessenberg[: k + 1, k] += parts
        rest = float(np.linalg.norm(image))
        if rest <= EXHAUSTED * size:
            return Krylov(hessenberg[: k + 1, : k + 1], length, np.array(seen))
        hessenberg[k + 1, k] = rest
        basis[k + 1] = image / rest
    return Krylov(hessenberg[:dimension], length, np.array(seen))
