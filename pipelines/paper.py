"""The paper, claim by claim: runs the studies of Lin & Song 1997 and writes a page over all of them.

``python -m pipelines.paper`` leaves ``outputs/studies/paper/report.html``: a table of what the paper says beside what
was measured, then the sections of each study.
"""

from pathlib import Path

from cmacexp.commands.study import command, study_parser, write_collection
from cmacexp.study.study import load_study

STUDIES = ("lead_design", "force_methods", "one_leg_learning", "quadruped_walking", "cmac_size", "assumptions")
TITLE = "Lin & Song 1997, claim by claim"
QUESTION = (
    "Learning Hybrid Position/Force Control of a Quadruped Walking Machine Using a CMAC Neural Network, repeated: "
    "which of its claims do new runs reproduce?"
)


def main() -> None:
    """Run all studies and write one report."""
    folder = Path(__file__).parent
    command(
        study_parser("pipelines.paper", QUESTION),
        lambda arguments, options: write_collection(
            "paper", TITLE, QUESTION, [load_study(folder / f"{name}.py") for name in STUDIES], options
        ),
    )


if __name__ == "__main__":
    main()
