"""``cmacexp stability``: predict whether learning stays bounded, and with which lead."""

from pathlib import Path

from cmacexp.commands.command import FOLDERS, Arguments, command, make_flag
from cmacexp.data.folder import OUT_KEY, choose_page_folder
from cmacexp.data.manifest import runs_below
from cmacexp.data.run import Run
from cmacexp.errors import require
from cmacexp.terminal.messages import announce_compiling, print_table
from cmacexp.terminal.output import print_line, show_activity

FOLDER = "stability"


def _analyse_run(run: Run, out: Path, trust: bool) -> None:
    """Write and print the verdict on a run, with the analysis or the reason for its absence.

    ``trust`` as in :func:`read_config`.
    """
    from cmacexp.addons.stability.cycle_map import NotPredictable
    from cmacexp.addons.stability.page import TITLES, advise, make_rows, write_stability_report
    from cmacexp.addons.stability.verdict import analyse, assess, read_learning

    analysis = None
    notes: list[str] = []
    with show_activity(f"analysing {run.folder}"):
        config = read_learning(run, trust)
        verdict = assess(config)
        try:
            analysis = analyse(config, verdict)
            notes += advise(analysis)
        except NotPredictable as error:
            if f"{error}." not in verdict.reasons:
                notes.append(f"No analysis: {error}.")
        path = write_stability_report(run, verdict, analysis, notes, out)
    print_line(verdict.describe())
    if analysis is not None:
        print_table([title.replace(" ", "\n", 1) for title in TITLES], make_rows(analysis))
    for line in notes:
        print_line(line)
    print_line(str(path))


@command(
    "stability",
    "Linearise the loop of each run, predict for each lead whether learning grows from cycle to cycle, and compare "
    "the prediction with a simulation; the result is an HTML page with figures and stability.json.",
    {
        **FOLDERS,
        "--out": {
            "type": Path,
            "metavar": "FOLDER",
            "help": f"folder of the page (default: {FOLDER} in DIR)",
        },
        "--trust": make_flag("import custom components named in the manifest; this runs their code"),
    },
)
def main(arguments: Arguments) -> None:
    """Analyse each run in the given folders."""
    announce_compiling()
    folders = list(dict.fromkeys(run for folder in arguments.folders for run in runs_below(folder)))
    require(
        arguments.out is None or len(folders) == 1,
        OUT_KEY,
        arguments.out,
        f"is for one run, but {len(folders)} were given",
    )
    for folder in folders:
        _analyse_run(Run(folder), choose_page_folder(arguments.out, folder / FOLDER), arguments.trust)
