"""Robots of today: what learning, models and each part of the method are worth on them.

``python -m pipelines.robots`` (needs the extra ``robots``). Every robot takes its gains from one rule; none is tuned.
Feedforwards are compared on five robots. One of them walks without each part of the method, five more walk with the
same rule, and the first five also walk on a rigid floor.
"""

from typing import Any

from cmacexp.commands.study import main
from cmacexp.study import Results, Study
from pipelines.common_results import share_of_time
from pipelines.robots_findings import FINDINGS
from pipelines.robots_runs import CMAC, FEEDFORWARDS, LEAD, LEARNERS, LEFT_OUT, PLANAR, STARTS, TRIED, runs
from pipelines.robots_tables import FIGURES, TABLES


def values(results: Results) -> dict[str, Any]:
    """Configs and counts that the page names."""
    disturbed = results.select(part=STARTS)
    return {
        "tried": TRIED,
        "learning": results.select(part=FEEDFORWARDS, kind=CMAC).run.config,
        "disturbed": disturbed.run.config,
        "compared": min(results.select(part=FEEDFORWARDS, kind=list(LEARNERS)).values("cycles")),
        "left_out": results.select(part=LEFT_OUT).run.config,
        "drifted": results.select(part=LEAD).value("cycles"),
        "planar": results.select(part=PLANAR).run.config,
        "starts": len(disturbed.values("seed")),
    }


STUDY = Study(
    title="Robots of today",
    question="Do CMAC, models and iterative learning make today's quadrupeds walk accurately with gains by one rule, "
    "and what is each part of the method worth?",
    runs=runs,
    measures={"walked": share_of_time},
    findings=FINDINGS,
    figures=FIGURES,
    tables=TABLES,
    values=values,
)

if __name__ == "__main__":
    main(__file__)
