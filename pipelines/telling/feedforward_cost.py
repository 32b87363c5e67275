"""What a step costs with each feedforward, measured in this process, one after the other and over again."""

from typing import TYPE_CHECKING

import pyarrow as pa

from cmacexp.config.compose import compose_config
from cmacexp.rollout import stream
from cmacexp.scenario import make_scenario
from pipelines.telling.feedforward_kinds import ALONE, KINDS

if TYPE_CHECKING:
    import pandas as pd

CYCLES, ROUNDS = 10, 5


def cost_table(quick: bool) -> pa.Table:
    """Seconds of a step of one leg by kind and round, without compiling."""
    rows = []
    configs = {
        kind: compose_config(
            ["scenario=one_leg", "reference=aware", f"cycles={2 if quick else CYCLES}", *how.overrides]
        )
        for kind, how in KINDS.items()
    }
    for turn in range(2 if quick else ROUNDS):
        for kind, config in configs.items():
            end = stream(make_scenario(config), lambda samples: None)
            rows.append({"kind": kind, "round": turn, "seconds_per_step": end.seconds / end.steps})
    return pa.Table.from_pylist(rows)


def ratios(cost: "pd.DataFrame") -> "pd.DataFrame":
    """Time of a step over that of feedback alone in the same round: a row for each round, a column for each kind."""
    by_round = cost.pivot(index="round", columns="kind", values="seconds_per_step")
    return by_round.div(by_round[ALONE], axis=0)
