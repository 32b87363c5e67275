"""Radial basis functions: a network of Gaussians along the planned path."""

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
    """``number`` of ``points`` (samples, n): the first, then the farthest from all chosen before (Gonzalez 1985)."""
    chosen, distance = [0], np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < number:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return points[chosen]


def spacing(points: Array) -> float:
    """Mean distance of each of ``points`` (centres, n) from its nearest one, in their unit; 1 where that is 0."""
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    np.fill_diagonal(distance, np.inf)
    mean = float(distance.min(axis=1).mean())
    return mean if 0.0 < mean < np.inf else 1.0


def activations(points: Array, centres: Array, width: float, active: int) -> tuple[Cells, Array]:
    """The ``active`` of ``centres`` (centres, n) nearest to each of ``points`` (samples, n), and their activations.

    Both are (samples, active). ``width`` is sigma of exp(-d^2 / (2 sigma^2)); activations of a sample sum up to 1.
    """
    square = ((points[:, None] - centres) ** 2).sum(axis=2)
    nearest = square.argsort(axis=1, kind="stable")[:, :active]
    near = np.take_along_axis(square, nearest, axis=1)
    # Relative to the nearest one, so that the sum is not zero far from all of them.
    height: Array = exponential((near[:, :1] - near) / (2.0 * width**2))
    return nearest.astype(np.uint32), height / height.sum(axis=1, keepdims=True)


class RadialBasis(BuiltInFeedforward):
    """Normalised Gaussians over planned joint values, one network per leg, trained by the feedback.

    Centres and widths are fixed, the outer weights learn (Moody & Darken 1989; in adaptive control Sanner & Slotine
    1992). Centres are samples of the planned path, spread evenly over it in inputs scaled to their span; all widths
    are the same. Only the nearest Gaussians are active.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Inputs, number and width of the Gaussians of one leg."""

        inputs: list[str] = choice(*INPUTS)
        """Planned joint values."""
        centres: int = number("", at_least=1, at_most=4096, tuned=[50, 100, 200, 400])
        """Gaussians, spread evenly over the path."""
        active: int = number("", at_least=1, at_most=4096, tuned=[4, 12, 24])
        """Nearest Gaussians that are active at a sample."""
        width: float = number("", above=0, at_most=1e3, tuned=(0.5, 3.0))
        """Standard deviation of a Gaussian over the mean distance between neighbouring centres."""

        def check(self, config: Config) -> None:
            """Check that there are as many centres as active ones; raises BadInput."""
            require(
                self.active <= self.centres,
                "feedforward.active",
                self.active,
                f"must be at most feedforward.centres={self.centres}",
            )

    config: Config

    def reset(self, setup: Setup) -> None:
        """Place the centres along the path; start with weights of zero, or those of an earlier run.

        Raises BadInput if a cycle has fewer samples than centres, or learning rule or earlier weights do not fit.
        """
        samples, legs = setup.plan.support.shape
        number = self.config.centres
        require(
            number <= samples, "feedforward.centres", number, f"must be at most {samples}, the samples of a cycle"
        )
        inputs = [planned_inputs(setup, i, self.config.inputs) for i in range(legs)]
        if setup.learnt is None:
            ranges = [spanning(own, 1.0) for own in inputs]
            self.ranges = np.stack([np.stack(own) for own in ranges])
            self.places = np.stack([spread_out(own, number) for own in map(_scaled, inputs, self.ranges)])
        else:
            self.ranges, self.places = setup.learnt["ranges"], setup.learnt["places"]
        found = [
            activations(_scaled(own, ends), places, self.config.width * spacing(places), self.config.active)
            for own, ends, places in zip(inputs, self.ranges, self.places, strict=True)
        ]
        cells, activation = (np.stack(own, axis=1) for own in zip(*found, strict=True))
        self.params = network(setup, cells, number, activation)
        used = [len(np.unique(own)) for own, _ in found]
        self.memory = [MemoryUse(number, rows, rows, 0, 0) for rows in used]

    def learnt(self) -> Weights:
        """``weights`` (L, centres, J), N m; ``ranges`` (L, 2, n) of inputs; ``places`` (L, centres, n) in them."""
        return {"weights": self.params.weights.copy(), "ranges": self.ranges, "places": self.places}


def _scaled(inputs: Array, ranges: Array) -> Array:
    """``inputs`` (samples, n) scaled to 0 to 1 over ``ranges`` (2, n), low and high."""
    return (inputs - ranges[0]) / (ranges[1] - ranges[0])
