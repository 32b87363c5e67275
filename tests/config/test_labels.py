"""Runs side by side are named by the settings in which they differ."""

import pytest
from support.doors import compose_config

from cmacexp.config import to_plain
from cmacexp.config.describe import labels


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (["cmac.layers=8"], ["cmac.layers=16", "record=trace"], ["cmac.layers=8", "cmac.layers=16"]),
        (["feedforward=none"], ["feedforward=cmac"], ["feedforward=none", "feedforward=cmac"]),
        (["scenario=one_leg"], ["scenario=quadruped"], ["one_leg", "quadruped"]),
        (["record=full"], ["record=trace"], ["a", "b"]),
        (["terrain=patchy"], ["terrain=soft_flat", "seed=1", "cycles=2"], ["a", "b"]),
    ],
)
def test_runs_are_named_by_what_differs_or_by_their_folders_if_that_is_nothing_or_too_much(first, second, expected):
    plain = [to_plain(compose_config(overrides)) for overrides in (first, second)]
    assert labels(plain, ["a", "b"]) == expected
