"""``python -m cmacexp.score DIR``: computes the metrics again from the trace, without simulating."""

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
    """Compute and write the metrics of a run again; raises BadRun if its trace is not as it was written."""
    run = Run(folder)
    require_intact(folder / TRACE_FILE)  # a run without one has a config of any kind
    record = run.config["record"]
    for key in ("every_nth_step", "cycles"):
        BadRun.unless(
            record.get(key) in (None, 1),
            f"{folder}: its trace lacks steps (record.{key}={record.get(key)}): metrics need all steps",
        )
    scores = score_traces(run)
    update_run(folder, lambda part: write_scores(part, scores), drift=make_drift_entry(scores.legs))
    return scores


@command("score", "Compute the metrics of runs again from their traces.", FOLDERS)
def main(arguments: Arguments) -> None:
    """Score the runs, and print their metrics."""
    for folder in select_traced(run for given in arguments.folders for run in runs_below(given)):
        with show_activity(f"scoring {folder}"):
            scores = score(folder)
        print_line(str(folder))
        print_scores(scores, folder)
    print_line(KEY)
