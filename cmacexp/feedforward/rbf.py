"""Feedforward with a radial basis function network: Gaussians along the planned path."""

from dataclasses import dataclass

import numpy as np

from cmacexp.cmac.addressing import spanning
from cmacexp.cmac.network import MemoryUse
from cmacexp.config import Config, FeedforwardConfig, choice, number
from cmacexp.config.cmac import INPUTS
from cmacexp.errors import require
from cmacexp.feedforward.network import BuiltInFeedforward, exponential, network, planned_inputs
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Cells, Weights


def spread_out(points: Array, number: int) -> Array:
    """Select ``number`` of ``points`` (samples, n) spread over them by farthest-point sampling (Gonzalez 1985).

    The first point is always selected; each of the others is the farthest from all selected before.
    """
    chosen = [0]
    distance = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < number:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return points[chosen]


def spacing(points: Array) -> float:
    """Compute the mean nearest-neighbour distance of ``points`` (centres, n), in their unit.

    Returns 1 if the distance is 0 or there is only one point.
    """
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    np.fill_diagonal(distance, np.inf)
    mean = float(distance.min(axis=1).mean())
    return mean if 0.0 < mean < np.inf else 1.0


def activations(points: Array, centres: Array, width: float, active: int) -> tuple[Cells, Array]:
    """Find the ``active`` nearest of ``centres`` (centres, n) for each of ``points`` (samples, n), and activations.

    Returns indices of centres and activations, both (samples, active). ``width`` is sigma of
    exp(-d^2 / (2 sigma^2)); the activations of a sample are normalised to the sum 1.
    """
    square = ((points[:, None] - centres) ** 2).sum(axis=2)
    nearest = square.argsort(axis=1, kind="stable")[:, :active]
    near = np.take_along_axis(square, nearest, axis=1)
    # Relative to the nearest centre, so that the sum does not underflow far from all centres.
    height: Array = exponential((near[:, :1] - near) / (2.0 * width**2))
    return nearest.astype(np.uint32), height / height.sum(axis=1, keepdims=True)


class RadialBasis(BuiltInFeedforward):
    """Normalised Gaussians over planned joint values, one network per leg, trained by the feedback.

    Centres and widths are fixed, the output weights learn (Moody & Darken 1989; in adaptive control Sanner & Slotine
    1992). Centres are samples of the planned path, spread evenly over it after scaling the inputs to their span; all
    widths are equal. Only the nearest Gaussians are active.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Inputs, number and width of the Gaussians of one leg."""

        inputs: list[str] = choice(*INPUTS)
        """Planned joint values that are inputs of the network."""
        centres: int = number("", at_least=1, at_most=4096, tuned=[50, 100, 200, 400])
        """Number of Gaussians, spread evenly over the path."""
        active: int = number("", at_least=1, at_most=4096, tuned=[4, 12, 24])
        """Number of nearest Gaussians that are active at a sample."""
        width: float = number("", above=0, at_most=1e3, tuned=(0.5, 3.0))
        """Standard deviation of a Gaussian / mean distance between neighbouring centres."""

        def check(self, config: Config) -> None:
            """Check that no more Gaussians are active than there are centres; raises BadInput."""
            require(
                self.active <= self.centres,
                "feedforward.active",
                self.active,
                f"must be at most feedforward.centres={self.centres}",
            )

    config: Config

    def reset(self, setup: Setup) -> None:
        """Place the centres along the path; start with zero weights, or with those of an earlier run.

        Raises BadInput if a cycle has fewer samples than centres, or if learning rule or earlier weights do not fit.
        """
        samples, legs = setup.plan.support.shape
        number = self.config.centres
        require(
            number <= samples, "feedforward.centres", number, f"must be at most {samples}, the samples of a cycle"
        )
        inputs = [planned_inputs(setup, i, self.config.inputs) for i in range(legs)]
        if setup.learnt is None:
            self.ranges = np.stack([np.stack(spanning(leg_inputs, 1.0)) for leg_inputs in inputs])
            self.places = np.stack([spread_out(scaled, number) for scaled in map(_scaled, inputs, self.ranges)])
        else:
            self.ranges = setup.learnt["ranges"]
            self.places = setup.learnt["places"]
        gaussians = [
            activations(scaled, centres, self.config.width * spacing(centres), self.config.active)
            for scaled, centres in zip(map(_scaled, inputs, self.ranges), self.places, strict=True)
        ]
        cells, activation = (np.stack(arrays, axis=1) for arrays in zip(*gaussians, strict=True))
        self.params = network(setup, cells, number, activation)
        used = [len(np.unique(rows)) for rows, _ in gaussians]
        self.memory = [MemoryUse(number, rows, rows, 0, 0) for rows in used]

    def learnt(self) -> Weights:
        """Return ``weights`` (L, centres, J), N m; input ``ranges`` (L, 2, n); centres, ``places`` (L, centres, n).

        Centres are in inputs scaled to 0 to 1 over their range.
        """
        return {"weights": self.params.weights.copy(), "ranges": self.ranges, "places": self.places}


def _scaled(inputs: Array, ranges: Array) -> Array:
    """Scale ``inputs`` (samples, n) to 0 to 1 over their ``ranges`` (2, n), low and high."""
    return (inputs - ranges[0]) / (ranges[1] - ranges[0])
