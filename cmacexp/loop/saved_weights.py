"""Weights of a feedforward that the guard of learning saves at the end of the best cycle, and returns to."""

import numpy as np

from cmacexp.feedforward.kernels import FeedforwardParams
from cmacexp.loop.scenario import Scenario


class SavedWeights:
    """Weights as the guard sees them: by themselves none, of a feedforward whose weights nobody knows or needs."""

    def save(self, cycle: int) -> None:
        """Save the weights in use, at the end of ``cycle``; 0: at the start of the run."""

    def restore(self) -> None:
        """Return to the weights that were saved last."""


class NetworkWeights(SavedWeights):
    """Saves the weights of a built-in network: the rows that the plan uses."""

    def __init__(self, params: FeedforwardParams):
        log = params.log
        legs = zip(params.weights, log.rows.astype(np.intp), log.used, strict=True)
        self._own = [(weights, rows[:used], weights[rows[:used]]) for weights, rows, used in legs]
        """Weights of each leg, the rows, and the weights of these that were saved last."""

    def save(self, cycle: int) -> None:
        """Save the weights in use."""
        for weights, rows, saved in self._own:
            np.take(weights, rows, axis=0, out=saved, mode="clip")  # with its default mode it would copy twice

    def restore(self) -> None:
        """Return to the weights that were saved last."""
        for weights, rows, saved in self._own:
            weights[rows] = saved


class CustomWeights(SavedWeights):
    """Saves those of a custom feedforward: the guard cannot return to them, but the result of the run has them."""

    def __init__(self, scenario: Scenario):
        self._scenario = scenario

    def save(self, cycle: int) -> None:
        """Note the weights in use as those of ``cycle``, and forget those of earlier cycles but the start, 0."""
        weights, kept = self._scenario.feedforward.learnt(), self._scenario.kept  # type: ignore[attr-defined]
        self._scenario.kept = {0: kept.get(0, weights), cycle: weights}
