"""The paper, claim by claim: runs the studies of Lin & Song 1997 and writes their report.

``python -m pipelines.paper`` leaves ``outputs/studies/paper/report.html``: a table of what the paper says beside what
was measured, its figures drawn again, and what it did not see.
"""

from pipelines import assumptions, cmac_size, force_methods, lead_design, one_leg_learning, quadruped_walking
from pipelines.shared.study import command, write_study

STUDIES = [
    lead_design.STUDY,
    force_methods.STUDY,
    one_leg_learning.STUDY,
    quadruped_walking.STUDY,
    cmac_size.STUDY,
    assumptions.STUDY,
]
TITLE = "Lin & Song 1997, claim by claim"
PURPOSE = (
    "Learning Hybrid Position/Force Control of a Quadruped Walking Machine Using a CMAC Neural Network, repeated: "
    "what the paper says beside what was measured, its figures drawn from new runs, and what it did not see."
)


def main() -> None:
    """Run all studies and write one report."""
    command("paper", PURPOSE, lambda folder, quick: write_study(STUDIES, TITLE, PURPOSE, folder, quick))


if __name__ == "__main__":
    main()
