"""The estimate of the memory of a run: near what it takes, and above what the machine has a refusal in one line."""

import tracemalloc

import pytest

from cmacexp.config import memory
from cmacexp.config.memory import LOOP, PROGRAM, available_memory, estimate_memory
from cmacexp.errors import BadInput
from cmacexp.experiment import run_scenario
from cmacexp.loop.scenario import make_scenario

RUN = ("scenario=one_leg", "cycles=1", "record=trace")


def measure_peak(work):
    """The most bytes that ``work`` allocates."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("overrides", [("cmac.layers=64",), ("feedforward=rbf",)], ids=" ".join)
def test_a_component_takes_about_as_much_memory_as_estimated(make_config, overrides):
    config = make_config(*RUN, "sampling_period=2.5e-3", *overrides)
    make_scenario(make_config(*RUN, *overrides))  # imports
    peak = measure_peak(lambda: make_scenario(config))
    assert estimate_memory(config)[0] - PROGRAM == pytest.approx(peak, rel=0.5)


def test_a_loop_takes_about_as_much_memory_as_estimated(make_config, tmp_path):
    config = make_config(*RUN, "feedforward=none")
    scenario = make_scenario(config)
    run_scenario(make_config(*RUN, "feedforward=none", "sampling_period=0.1"), tmp_path)  # imports
    peak = measure_peak(lambda: run_scenario(config, tmp_path, prepared=scenario))
    assert LOOP * config.steps_per_cycle == pytest.approx(peak, rel=0.5)


NEEDS = {
    (
        "sampling_period=1e-6",
        "feedforward=none",
    ): "sampling_period=1e-06: needs about 2.6 GB with 3000000 steps a cycle, "
    "but there are 2.0 GB: take a larger one",
    ("sampling_period=1e-6",): "sampling_period=1e-06: needs about 6.2 GB with 3000000 steps a cycle, "
    "but there are 2.0 GB: take a larger one, or a smaller cmac.layers",
    ("sampling_period=1e-5", "cmac.layers=4096"): "cmac.layers=4096: needs about 66.7 GB with 300000 steps a cycle, "
    "but there are 2.0 GB: take a smaller one, or a larger sampling_period",
    (
        "sampling_period=1e-5",
        "feedforward=rbf",
        "feedforward.centres=4000",
    ): "feedforward.centres=4000: needs about 48.3 "
    "GB with 300000 steps a cycle, but there are 2.0 GB: take a smaller one, or a larger sampling_period",
}


@pytest.mark.parametrize("overrides", NEEDS, ids=" ".join)
def test_what_needs_more_memory_than_there_is_is_refused(make_config, monkeypatch, overrides):
    monkeypatch.setattr(memory, "available_memory", lambda: 2e9)
    with pytest.raises(BadInput) as raised:
        make_config(*RUN, *overrides)
    assert str(raised.value) == NEEDS[overrides]


def test_a_control_group_limits_the_memory(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "GROUPS", tmp_path)
    machine = available_memory()
    assert 1e8 < machine < 1e15
    (tmp_path / "memory.max").write_text("max\n")
    assert available_memory() == machine
    (tmp_path / "memory.max").write_text("1000000\n")
    assert available_memory() == 1e6
