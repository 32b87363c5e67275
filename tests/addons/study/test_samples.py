"""Samples of runs: growth in a run, ratios to runs of the same seed; limits and overrides of declarations."""

import math

import numpy as np
import pytest
from support.made_studies import made_row

from cmacexp.addons.study.declaration import format_overrides, read_limit
from cmacexp.addons.study.interval import UNPAIRED
from cmacexp.study import ANY, Criterion, Finding, Results, at_most, between, compute_growth


def made(errors, asked, **settings):
    return made_row({"transfer_rmse_x": errors}, asked, cycles=asked, **settings)


BOTH = Results([made([4.0, 2.0, 1.0, 3.0], 4, seed=0), made([4.0, 2.0], 4, seed=1)])


@pytest.mark.parametrize(
    ("sample", "expected"),
    [
        (lambda runs: runs.end("transfer_rmse_x", 2), [2.0, math.inf]),
        (lambda runs: compute_growth(runs.end("transfer_rmse_x"), runs.at(1, "transfer_rmse_x")), [0.625, math.inf]),
        (lambda runs: compute_growth(np.full(2, math.inf), np.array([math.inf, 1.0])), [math.inf, math.inf]),
        (lambda runs: runs.completed, [True, False]),
        (lambda runs: runs.done, [1.0, 0.5]),
    ],
)
def test_a_sample_is_a_value_for_each_run_and_infinite_for_one_that_fell(sample, expected):
    np.testing.assert_array_equal(sample(BOTH), expected)


def test_over_divides_by_the_run_of_the_same_seed_and_counts_failures_apart():
    """The order of the runs does not matter; a run whose reference fell says nothing."""
    plain = [made([1.0, error], 2, kind="plain", seed=seed) for seed, error in ((2, 4.0), (0, 2.0))]
    learns = [made([1.0, error], 2, kind="learns", seed=seed) for seed, error in ((0, 3.0), (2, 1.0))]
    of, over = {"kind": "learns"}, {"kind": "plain"}
    ratio = Criterion("error", lambda runs: runs.end("transfer_rmse_x", 1), at_most(1.0), of=of, over=over)
    assert ratio.take(Results([*plain, *learns])).tolist() == [1.5, 0.25]
    fell = made([1.0], 2, kind="plain", seed=0)
    assert ratio.take(Results([plain[0], fell, *learns])).tolist() == [UNPAIRED, 0.25]


def test_a_sentence_without_words_is_made_of_quantity_value_interval_n_and_limit():
    own = Criterion("error", lambda results: [1e-3], at_most(2e-3), unit="mm", scale=1e3)
    assert Finding([own]).judge(BOTH).sentence == "error: 1 mm [deterministic], n = 1; limit at most 2 mm: yes."
    asked = Finding(6 * [own], says="It is small").judge(BOTH)
    assert asked.sentence == "It is small: yes (6 values; limit at most 2 mm)."


@pytest.mark.parametrize(
    ("text", "expected"),
    [("at most 10 %", (at_most(0.1), "%", 100.0)), ("1 to 3 mm", (between(1e-3, 3e-3), "mm", 1e3)),
     ("at most -2e-1 N m", (at_most(-0.2), "N m", 1.0)), ("any N s^2", (ANY, "N s^2", 1.0))],
)  # fmt: skip
def test_a_limit_is_read_in_its_unit(text, expected):
    assert read_limit(text) == expected


def test_overrides_of_a_mapping_are_what_the_command_line_takes():
    given = {
        "cmac.inputs": ["angle", "velocity"],
        "gait.touch_down": None,
        "learning.lead": "auto",
        "a": True,
        "b": 0.5,
    }
    texts = ["cmac.inputs=[angle, velocity]", "gait.touch_down=null", "learning.lead=auto", "a=true", "b=0.5"]
    assert format_overrides(given) == texts
