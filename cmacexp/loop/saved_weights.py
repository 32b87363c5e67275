"""Weight stores of the guard of learning, which saves the weights of the best cycle and restores them."""

import numpy as np

from cmacexp.feedforward.kernels import FeedforwardParams
from cmacexp.loop.scenario import Scenario


class SavedWeights:
    """Weight store of the guard; this base class stores nothing."""

    def save(self, cycle: int) -> None:
        """Save the present weights at the end of ``cycle``; 0 is the start of the run."""

    def restore(self) -> None:
        """Restore the saved weights, if the store has any."""


class NetworkWeights(SavedWeights):
    """Weight store for a built-in network; it saves only the rows that the plan uses."""

    def __init__(self, params: FeedforwardParams):
        log = params.log
        legs = zip(params.weights, log.rows.astype(np.intp), log.used, strict=True)
        self._legs = [(weights, rows[:used], weights[rows[:used]]) for weights, rows, used in legs]
        """Per leg: weights, row indices, and saved copy of these rows."""

    def save(self, cycle: int) -> None:
        """Save the present weights."""
        for weights, rows, saved in self._legs:
            np.take(weights, rows, axis=0, out=saved, mode="clip")  # with its default mode it would copy twice

    def restore(self) -> None:
        """Restore the saved weights."""
        for weights, rows, saved in self._legs:
            weights[rows] = saved


class CustomWeights(SavedWeights):
    """Weight store for a custom feedforward: saved for the result of the run, but never restored."""

    def __init__(self, scenario: Scenario):
        self._scenario = scenario

    def save(self, cycle: int) -> None:
        """Save the present weights as those of ``cycle``; only these and the weights at the start, 0, are kept."""
        weights = self._scenario.feedforward.learnt()  # type: ignore[attr-defined]  # it Learns
        self._scenario.kept = {0: self._scenario.kept.get(0, weights), cycle: weights}
