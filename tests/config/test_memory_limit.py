"""A cycle that does not fit into memory is refused before it is planned, with the sizes."""

import pytest
from support.doors import BadInput, make_scenario

from cmacexp.config import check
from cmacexp.config.compose import compose_config

LONG = ("sampling_period=1e-6", "cmac.memory_bytes=1048576")


@pytest.mark.parametrize(
    ("overrides", "key", "needed"),
    [
        (["cmac.layers=4096"], "cmac.layers", 2.8 + 137.3),
        (["cmac.layers=4096", "cmac.receptive_field=linear"], "cmac.layers", 2.8 + 251.8),
        (["feedforward=cmac_on_model", "cmac.layers=4096"], "cmac.layers", 2.8 + 137.3),
        (["feedforward=rbf", "feedforward.centres=400"], "feedforward.centres", 2.8 + 71.5),
        (["feedforward=ilc", "cmac.layers=4096"], "sampling_period", 2.8),
    ],
)
def test_the_key_that_matters_and_the_sizes_are_named(overrides, key, needed, monkeypatch):
    monkeypatch.setattr(check, "machine_memory", lambda: 2 * 2**30)
    config = compose_config([*LONG, *overrides])  # a stored one is valid wherever it is read
    with pytest.raises(BadInput, match=rf"^{key}=.* needs {needed:.1f} GiB, more than the 2\.0 GiB"):
        make_scenario(config)  # which would take minutes


def test_the_memory_of_a_process_is_that_of_the_machine_or_of_its_limit(monkeypatch):
    found = []
    for limit in (check.resource.RLIM_INFINITY, 2**30, 2**60):
        monkeypatch.setattr(check.resource, "getrlimit", lambda which, limit=limit: (limit, limit))
        found.append(check.machine_memory())
    assert found[0] > found[1] == 2**30
    assert found[2] == found[0]
