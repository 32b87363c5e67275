"""What a step costs with each feedforward, measured in one process, one after the other and over again."""

import time
from typing import TYPE_CHECKING

from cmacexp.config.compose import compose_config
from cmacexp.loop import stream
from cmacexp.loop.scenario import make_scenario
from cmacexp.study import Results
from pipelines.feedforwards_kinds import ALONE, LEARNERS, MLP, MODELS

if TYPE_CHECKING:
    import pandas as pd

CYCLES, ROUNDS, STEPPED_ROUNDS = 10, 30, 3
"""Of a run; runs of each kind, and of one that is worked on step by step, one more than are counted."""


def measure_costs(results: Results) -> "pd.DataFrame":
    """Processor time of a step of one leg by ``kind`` and ``round``, s; that of other programs is not in it."""
    import pandas as pd

    quick = max(results.values("cycles")) < CYCLES
    cycles = f"cycles={2 if quick else CYCLES}"
    configs = {
        kind: compose_config(["scenario=one_leg", "reference=aware", cycles, *overrides])
        for kind, overrides in {**MODELS, **LEARNERS}.items()
    }
    rows = []
    for turn in range(STEPPED_ROUNDS if quick else ROUNDS):
        for kind, config in configs.items():
            if kind == MLP and turn >= STEPPED_ROUNDS:
                continue
            scenario = make_scenario(config)
            began = time.process_time()
            end = stream(scenario, lambda samples: None)
            seconds = time.process_time() - began
            if turn:  # the first one loads compiled code
                rows.append({"kind": kind, "round": turn, "seconds_per_step": seconds / end.steps})
    return pd.DataFrame(rows)


def relative_costs(results: Results) -> "pd.DataFrame":
    """Time of a step over that of feedback alone, by kind: ``least`` over least, ``median`` over median."""
    cost = results.computed["cost"].groupby("kind", sort=False)["seconds_per_step"].agg(least="min", median="median")
    return cost / cost.loc[ALONE]
