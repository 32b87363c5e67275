"""The paper, claim by claim: runs the studies of Lin & Song 1997 and writes a page over all of them.

``python -m pipelines.paper`` leaves ``outputs/studies/paper/report.html``: a table of what the paper says beside what
was measured, then the sections of each study.
"""

from pathlib import Path

from cmacexp.commands.study import FOLDER_KEY, Options, command, print_statements, study_parser, write_studies
from cmacexp.data.folder import new_result
from cmacexp.data.manifest import REPORT
from cmacexp.study.page import write_page
from cmacexp.study.study_file import load_study

STUDIES = ("lead_design", "force_methods", "one_leg_learning", "quadruped_walking", "cmac_size", "assumptions")
TITLE = "Lin & Song 1997, claim by claim"
QUESTION = (
    "Learning Hybrid Position/Force Control of a Quadruped Walking Machine Using a CMAC Neural Network, repeated: "
    "which of its claims do new runs reproduce?"
)


def write(options: Options) -> Path:
    """Run all studies and write one page over them; returns it."""
    folder = Path(__file__).parent
    studies = write_studies([load_study(folder / f"{name}.py") for name in STUDIES], options, whole=True)
    print_statements(studies)
    with new_result(options.place("paper"), FOLDER_KEY, REPORT) as place:
        return write_page(TITLE, QUESTION, studies, place, options.quick)


def main() -> None:
    """Run the command."""
    command(study_parser("pipelines.paper", QUESTION), lambda arguments, options: write(options))


if __name__ == "__main__":
    main()
