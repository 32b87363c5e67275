"""Learning that hardly helps is said with a likely cause; learning that helps, or cannot be judged, is not."""

import re
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from support.doors import TREND_WINDOW

from cmacexp.metrics.progress import describe_little_progress

CYCLES = 30


def make_scores(last_error, last_feedback, share=0.0, cycles=CYCLES, restless=0.0):
    """Scores of one leg whose error and feedback fall from 0.1 m and 1 N m to their last values in cycle 5."""
    error, feedback = np.full(cycles, last_error), np.full(cycles, last_feedback)
    error[:5], feedback[:5] = 0.1, 1.0
    feedback[5:] *= 1.0 + restless * (-1.0) ** np.arange(cycles - 5)
    columns = {
        "cycle": np.arange(1.0, cycles + 1),
        "transfer_rmse_x": error,
        "transfer_rmse_y": np.zeros(cycles),
        "feedback_rms": feedback,
        "feedforward_share": np.full(cycles, share),
        "weight_norm": np.ones(cycles),
    }
    return SimpleNamespace(legs=pa.table(columns))


def make_config(position=100.0, velocity=5.0):
    return {
        "learning": {"start_cycle": 2},
        "gait": {"duty_factor": 0.8, "cycle_time": 3.0},
        "controller": {"position_gain": position, "velocity_gain": velocity},
    }


@pytest.mark.parametrize(
    ("config", "restless", "cause"),
    [
        (make_config(5.0, 5.0), 0.0, "errors decay within 1 s .* transfer of 0.6 s: use controller.position_gain=33"),
        (make_config(), 0.4, "from cycle to cycle: use a lower learning.rate"),
        (make_config(), 0.0, "has settled: use a larger learning.rate"),
    ],
)
def test_learning_that_hardly_helps_names_a_likely_cause(config, restless, cause):
    text = describe_little_progress(config, make_scores(0.095, 0.95, restless=restless))
    assert text.startswith(
        f"learning hardly helps: transfer error 100 mm in cycle 1, 95 mm in the last {TREND_WINDOW}"
    )
    assert re.search(cause, text)


@pytest.mark.parametrize(
    "scores",
    [
        make_scores(0.01, 0.95),
        make_scores(0.095, 0.1),
        make_scores(0.095, 0.95, share=0.9),
        make_scores(0.095, 0.95, cycles=TREND_WINDOW + 1),
    ],
    ids=["smaller errors", "less feedback", "a known torque", "too short"],
)
def test_learning_that_helps_or_cannot_be_judged_is_not_reported(scores):
    assert describe_little_progress(make_config(), scores) == ""
