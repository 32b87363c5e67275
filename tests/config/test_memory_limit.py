"""A cycle that does not fit into memory is refused before it is planned, with the sizes."""

import resource

import pytest

from cmacexp.config import check
from cmacexp.config.compose import compose_config
from cmacexp.errors import BadInput
from cmacexp.loop.scenario import make_scenario

GIB = 2**30


def refusal(overrides, gib, monkeypatch):
    """What refuses a run on a machine with so much memory."""
    monkeypatch.setattr(check, "machine_memory", lambda: round(gib * GIB))
    monkeypatch.setattr("cmacexp.loop.scenario.make_plan", lambda *given: pytest.fail("it was planned"))
    with pytest.raises(BadInput) as raised:
        make_scenario(compose_config(overrides))
    return raised.value


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
def test_the_keys_that_matter_and_the_sizes_are_named(overrides, key, needed, monkeypatch):
    overrides = ["sampling_period=1e-6", "cmac.memory_bytes=1048576", *overrides]
    error = refusal(overrides, 2.0, monkeypatch)
    assert error.key == key
    assert "sampling_period" in str(error)
    assert f"needs {needed:.1f} GiB, more than the 2.0 GiB" in str(error)
    assert "3000000 samples a cycle" in str(error)


def test_the_limit_is_sharp(monkeypatch):
    config = compose_config(["cmac.layers=64"])
    needed = config.steps_per_cycle * (check.SAMPLE_BYTES + 64 * check.CELL_BYTES)
    monkeypatch.setattr(check, "machine_memory", lambda: needed)
    check.check_memory(config)
    monkeypatch.setattr(check, "machine_memory", lambda: needed - 1)
    with pytest.raises(BadInput):
        check.check_memory(config)


def test_the_memory_of_a_process_is_that_of_the_machine_or_of_its_limit(monkeypatch):
    monkeypatch.setattr(resource, "getrlimit", lambda which: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    installed = check.machine_memory()
    assert installed > GIB
    monkeypatch.setattr(resource, "getrlimit", lambda which: (GIB, resource.RLIM_INFINITY))
    assert check.machine_memory() == GIB
    monkeypatch.setattr(resource, "getrlimit", lambda which: (2 * installed, resource.RLIM_INFINITY))
    assert check.machine_memory() == installed


def test_a_stored_config_is_valid_wherever_it_is_read(monkeypatch):
    monkeypatch.setattr(check, "machine_memory", lambda: 1)
    compose_config(["scenario=quadruped"])
