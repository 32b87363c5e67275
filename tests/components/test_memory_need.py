"""The estimate of the memory of a run: near what it takes, and above what the machine has a refusal in one line."""

import tracemalloc

import pytest
from support.robots import OWN

from cmacexp.config import memory
from cmacexp.config.memory import available_memory, estimate_memory
from cmacexp.errors import BadInput
from cmacexp.experiment.run import run_scenario

RUN = ("scenario=one_leg", "cycles=1", "record=trace")
ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}", "sampling_period=5e-4", "feedforward=none")
LAYERS = ("sampling_period=2.5e-3", "cmac.layers=64", "cmac.memory_bytes=16384")


@pytest.mark.parametrize(
    "overrides",
    [
        ("sampling_period=2.5e-4", "feedforward=none"),
        ROBOT,
        LAYERS,
        (*LAYERS, "cmac.receptive_field=linear"),
        ("sampling_period=2.5e-3", "feedforward=rbf"),
    ],
    ids=" ".join,
)
def test_a_run_takes_about_as_much_memory_as_estimated(make_config, tmp_path, overrides):
    config = make_config(*RUN, *overrides)
    run_scenario(config, tmp_path)  # imports
    tracemalloc.start()
    try:
        run_scenario(config, tmp_path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.5 < sum(estimate_memory(config).values()) / peak < 2.0


@pytest.mark.parametrize(
    ("key", "overrides"),
    [
        ("sampling_period", ["sampling_period=1e-6", "feedforward=none"]),
        ("cmac.layers", ["sampling_period=1e-5", "cmac.layers=4096"]),
        ("feedforward.centres", ["sampling_period=1e-5", "feedforward=rbf", "feedforward.centres=4000"]),
    ],
)
def test_what_needs_more_memory_than_there_is_is_refused(make_config, monkeypatch, key, overrides):
    monkeypatch.setattr(memory, "available_memory", lambda: 2e9)
    with pytest.raises(BadInput) as raised:
        make_config(*RUN, *overrides)
    assert raised.value.key == key


@pytest.mark.parametrize(
    ("more", "copies"), [((), 0), (("record.weights=true",), 4), (("learning.start_from=a",), 8)]
)
def test_copies_of_the_weights_count(make_config, more, copies):
    config = make_config("scenario=quadruped", "cmac.memory_bytes=1000000000", *more)
    assert estimate_memory(config)["cmac.memory_bytes"] == copies * 1e9


def test_a_control_group_limits_the_memory(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "GROUPS", tmp_path)
    machine = available_memory()
    assert 1e8 < machine < 1e15
    (tmp_path / "memory.max").write_text("max\n")
    assert available_memory() == machine
    (tmp_path / "memory.max").write_text("1000000\n")
    assert available_memory() == 1e6
