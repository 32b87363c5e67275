"""What is known of learning in a cycle follows from that cycle and those before."""

import numpy as np
from numpy.testing import assert_array_equal
from support.made_traces import make_trace

from cmacexp.metrics import compute
from cmacexp.metrics.registry import METRICS


def learning(cycles, legs=1):
    """A trace of ``cycles`` cycles of four steps whose errors change from cycle to cycle and leg to leg."""
    rng = np.random.default_rng(7)
    size = (4 * cycles, legs)
    decay = np.repeat(np.exp(-0.4 * np.arange(cycles)), 4)[:, None]
    columns = {name: decay * rng.uniform(0.5, 1.5, size) for name in ("x", "y", "tau_feedback_1")}
    return {"rows": 4 * cycles, "legs": legs, "force": 1.0 + decay * rng.uniform(0.5, 1.5, size), **columns}


def test_a_row_knows_nothing_of_later_cycles():
    trace = make_trace("TSSS", **learning(8, legs=2), force_desired=1.0)
    whole = compute(trace, 4)
    for cycles in range(1, 8):
        begun = compute(trace.slice(0, 8 * cycles), 4)
        for name in METRICS:
            assert_array_equal(
                begun.column(name).to_numpy(), whole.column(name).to_numpy()[: 2 * cycles], err_msg=name
            )
