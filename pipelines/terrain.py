"""Ground and load that change during a run, patches and slopes, all unknown to the planner.

``python -m pipelines.terrain`` makes the ground three times as stiff or puts 10 N on the body in the middle of a run,
and lets machines walk over patches and slopes, each with and without CMAC. What it claims: with a learning rule that
lasts, continued learning brings the errors back within some cycles, below those of feedback alone; it does not
correct what the plan assumes wrongly about ground and weight. About a minute on two cores.
"""

from cmacexp.report.page import Section
from pipelines.analysis import terrain_recovery, terrain_shape
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main


def jobs(quick: bool) -> Jobs:
    """Changes, patches and slopes."""
    return {**terrain_recovery.jobs(quick), **terrain_shape.jobs(quick)}


def summarise(runs: Runs) -> list[Section]:
    """A section for each, which ends in advice."""
    return [terrain_recovery.section(runs), *terrain_shape.sections(runs)]


STUDY = Study(
    "terrain",
    "Ground and load that change",
    "How many cycles learning takes to recover from a step of the ground's stiffness and from a payload, with and "
    "without CMAC; how uneven and how steep the ground may be.",
    jobs,
    summarise,
)

if __name__ == "__main__":
    main(STUDY)
