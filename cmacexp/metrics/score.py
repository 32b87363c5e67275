"""The metrics of a stored run from its traces."""

from pathlib import Path

from cmacexp.data.tables import BODY, MEMORY, TRACE, Scores, _parts
from cmacexp.metrics import BodyScorer, Scorer


def score_traces(folder: Path, steps_per_cycle: int) -> Scores:
    """The metrics of a run from its traces, which must hold every step.

    Raises:
        BadRun: a trace is missing or cannot be read.
    """
    legs, body = Scorer(steps_per_cycle), BodyScorer(steps_per_cycle)
    for part in _parts(folder / TRACE):
        legs.add(part)
    if (folder / MEMORY).exists():
        for part in _parts(folder / MEMORY):
            legs.add_memory(part)
    if not (folder / BODY).exists():
        return Scores(legs.table(), None)
    for part in _parts(folder / BODY):
        body.add(part)
    return Scores(legs.table(), body.table())
