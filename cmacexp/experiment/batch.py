"""Many runs in memory, on all cores: nothing is written."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pyarrow as pa

from cmacexp.errors import BadInput
from cmacexp.experiment.sweep_results import parse_overrides
from cmacexp.experiment.sweep_table import join_scores, stack
from cmacexp.experiment.workers import workers

if TYPE_CHECKING:
    import pandas as pd

METRICS, TRACE = KEPT = ("metrics", "trace")


def run_many(runs: Sequence[Sequence[str]], keep: str = METRICS, processes: int | None = None) -> "pd.DataFrame":
    """Run many configs in memory, in processes on all cores, compiled where that pays off for all of them together.

    Args:
        runs: overrides of each run, as :func:`run` takes them.
        keep: ``metrics``, a row for each run, cycle and leg, or ``trace``, a row for each run, step and leg.
        processes: how many; None: one for each core that this process may use.

    Returns:
        A table: ``run``, its number; a column for each key that some run overrides; ``status``; the columns of
        ``metrics.parquet`` and ``body_metrics.parquet``, or of ``trace.parquet``.

    Raises:
        CmacexpError: one of them cannot be run; nothing is returned then.
    """
    if keep not in KEPT:
        raise BadInput("keep", keep, f"choose from {', '.join(KEPT)}")
    for overrides in runs:
        if isinstance(overrides, str):
            raise BadInput("runs", overrides, f"must be a list of lists of overrides: [[{overrides!r}]]")
    if not runs:
        raise BadInput("runs", list(runs), "must have at least one run")
    with workers(processes=processes) as each:
        done = each("running", _run, [(list(overrides), keep, len(runs)) for overrides in runs])
    rows = [
        {"run": number, **values, "status": status}
        for number, (values, (status, _)) in enumerate(zip(parse_overrides(runs), done, strict=True))
    ]
    return stack(rows, [table for _, table in done])


def _run(overrides: list[str], keep: str, runs: int) -> tuple[str, pa.Table]:
    """How one of so many runs ended, and what is kept of it."""
    from cmacexp.config import to_config
    from cmacexp.config.compose import compose_untyped
    from cmacexp.experiment.run import score_scenario
    from cmacexp.jit.compiler import expect_runs
    from cmacexp.loop.scenario import make_scenario

    expect_runs(runs)
    traces = list[pa.Table]()
    scenario = make_scenario(to_config(compose_untyped(overrides)[0]))
    end, scores = score_scenario(scenario, lambda new: traces.append(new.legs) if keep == TRACE else None)
    return end.status, pa.concat_tables(traces) if traces else join_scores(scores)
