"""``python -m cmacexp.score DIR``: recomputes the metrics from the trace, without simulation."""

from pathlib import Path

from cmacexp.commands.command import FOLDERS, Arguments, command
from cmacexp.data.folder import update_run
from cmacexp.data.manifest import require_intact, runs_below
from cmacexp.data.run import Run
from cmacexp.data.tables import TRACE_FILE, Scores, write_scores
from cmacexp.errors import BadRun
from cmacexp.metrics.drift import make_drift_entry
from cmacexp.metrics.score import score_traces
from cmacexp.terminal.messages import KEY, print_scores, select_traced
from cmacexp.terminal.output import print_line, show_activity


def score(folder: Path) -> Scores:
    """Recompute and store the metrics of a run; raises BadRun if its trace is incomplete or was changed."""
    run = Run(folder)
    require_intact(folder / TRACE_FILE)  # first, since the config of a run without a trace may have any form
    record = run.config["record"]
    for key in ("every_nth_step", "cycles"):
        BadRun.unless(
            record.get(key) in (None, 1),
            f"{folder}: its trace lacks steps (record.{key}={record.get(key)}): metrics need all steps",
        )
    scores = score_traces(run)
    update_run(
        folder, lambda partial_folder: write_scores(partial_folder, scores), drift=make_drift_entry(scores.legs)
    )
    return scores


@command("score", "Recompute the metrics of runs from their traces.", FOLDERS)
def main(arguments: Arguments) -> None:
    """Recompute and print the metrics of the runs."""
    for folder in select_traced(run for parent in arguments.folders for run in runs_below(parent)):
        with show_activity(f"scoring {folder}"):
            scores = score(folder)
        print_line(str(folder))
        print_scores(scores, folder)
    print_line(KEY)
