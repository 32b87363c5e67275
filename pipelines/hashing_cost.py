"""What addressing a sample takes: hashed, looked up among visited cells, and neither."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.cmac.addressing import address_batch
from cmacexp.cmac.network import Cmac
from cmacexp.cmac.quantiser import spanning
from cmacexp.config.compose import compose_config
from cmacexp.feedforward.network import planned_inputs
from cmacexp.loop.scenario import make_scenario
from cmacexp.study import Results

if TYPE_CHECKING:
    import pandas as pd


def _least_time(work: Callable[[], object], repeats: int = 15) -> float:
    """Seconds of the fastest of some ``repeats``."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def addressing_cost(results: Results) -> "pd.DataFrame":
    """What addressing one sample of one leg takes: ``way`` (hashed, visited, neither) and ``time``, ns."""
    import pandas as pd

    setup = make_scenario(compose_config(["scenario=one_leg"])).setup
    inputs = np.ascontiguousarray(planned_inputs(setup, 0, setup.config.cmac.inputs))
    ranges = spanning(inputs, setup.config.cmac.range_factor)
    hashing, visiting = (Cmac(replace(setup.config.cmac, addressing=name), ranges) for name in ("hashed", "visited"))
    positions = np.empty((len(inputs), visiting.layers), dtype=np.uint64)
    visiting.cells(inputs)
    took = {
        "hashed": _least_time(lambda: hashing.cells(inputs)),
        "visited": _least_time(lambda: visiting.cells(inputs)),
        "neither": _least_time(lambda: address_batch(visiting.address, inputs, positions)),
    }
    return pd.DataFrame({"way": list(took), "time": [1e9 * seconds / len(inputs) for seconds in took.values()]})
