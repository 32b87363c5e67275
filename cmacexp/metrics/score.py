"""The metrics of a run from its tables, which may come in parts."""

from pathlib import Path

from cmacexp.data.tables import BODY, MEMORY, TRACE, Scores, Traces, read_parts
from cmacexp.metrics.body import BodyScorer
from cmacexp.metrics.compute import Scorer
from cmacexp.metrics.drift import Drift


class RunScorer:
    """The metrics of a run whose tables come part by part.

    Args:
        steps_per_cycle: N.
    """

    def __init__(self, steps_per_cycle: int):
        self.legs, self.body = Scorer(steps_per_cycle), BodyScorer(steps_per_cycle)

    def add(self, traces: Traces) -> None:
        """Score the next cycles; only the last of the run may be short."""
        self.legs.add(traces.legs)
        if traces.body is not None:
            self.body.add(traces.body)
        if traces.memory is not None:
            self.legs.add_memory(traces.memory)

    @property
    def drift(self) -> Drift | None:
        """The first drift detected so far."""
        return self.legs.drift

    @property
    def scores(self) -> Scores:
        """The metrics of all cycles so far."""
        return Scores(self.legs.table(), self.body.table() if self.body.parts else None)


def score_traces(folder: Path, steps_per_cycle: int) -> Scores:
    """The metrics of a run from its traces, which must hold every step.

    Raises:
        BadRun: a trace is missing or cannot be read.
    """
    scorer = RunScorer(steps_per_cycle)
    takes = {TRACE: scorer.legs.add, MEMORY: scorer.legs.add_memory, BODY: scorer.body.add}
    for name, take in takes.items():
        if name == TRACE or (folder / name).exists():
            for part in read_parts(folder / name):
                take(part)
    return scorer.scores
