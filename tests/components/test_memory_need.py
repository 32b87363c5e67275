"""The estimate of the memory of a run: near what it takes, and above what the machine has a refusal in one line."""

import tracemalloc

import numpy as np
import pytest
from support.robots import OWN

from cmacexp.cmac import spread
from cmacexp.cmac.spread import spread_shares
from cmacexp.config import memory
from cmacexp.config.memory import LOOP, PLAN, PROGRAM, available_memory, estimate_memory
from cmacexp.errors import BadInput
from cmacexp.experiment.run import run_scenario
from cmacexp.loop.scenario import make_scenario

LAYERS = ("cmac.layers=64", "cmac.memory_bytes=16384")
RUN = ("scenario=one_leg", "cycles=1", "record=trace")
ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}")


def measure_peak(work):
    """The most bytes that ``work`` allocates."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "overrides", [(*LAYERS,), (*LAYERS, "cmac.receptive_field=linear"), ("feedforward=rbf",)], ids=" ".join
)
def test_a_component_takes_about_as_much_memory_as_estimated(make_config, overrides):
    config = make_config(*RUN, "sampling_period=2.5e-3", *overrides)
    make_scenario(make_config(*RUN, *overrides))  # imports
    peak = measure_peak(lambda: make_scenario(config))
    assert estimate_memory(config)[0] - PROGRAM == pytest.approx(peak, rel=0.5)


@pytest.mark.parametrize(
    ("coarse", "fine", "machine"),
    [("0.005", "0.0005", ("scenario=one_leg",)), ("0.001", "0.0005", ROBOT)],
    ids=["one_leg", "robot"],
)
def test_plan_and_loop_take_about_as_much_memory_as_estimated(make_config, tmp_path, coarse, fine, machine):
    def make(period):
        return make_config(*RUN, *machine, "feedforward=none", "learning.start_cycle=1", f"sampling_period={period}")

    config = make(fine)
    run_scenario(make(coarse), tmp_path)  # imports
    rows, made = config.steps_per_cycle * config.legs, []
    planning = measure_peak(lambda: made.append(make_scenario(config)))
    assert PLAN[config.joints] * rows == pytest.approx(planning, rel=0.5)
    running = measure_peak(lambda: run_scenario(config, tmp_path, prepared=made[0]))
    assert LOOP[config.joints] * rows == pytest.approx(running, rel=0.5)


NEEDS = {
    (
        "sampling_period=1e-6",
        "feedforward=none",
    ): "sampling_period=1e-06: needs about 2.6 GB with 3000000 steps a cycle, "
    "but there are 2.0 GB: take a larger one",
    (
        "sampling_period=1e-6",
        "cmac.layers=64",
    ): "sampling_period=1e-06: needs about 3.7 GB with 3000000 steps a cycle, "
    "but there are 2.0 GB: take a larger one, or a smaller cmac.layers",
    ("sampling_period=1e-5", "cmac.layers=4096"): "cmac.layers=4096: needs about 17.6 GB with 300000 steps a cycle, "
    "but there are 2.0 GB: take a smaller one, or a larger sampling_period",
    (
        "sampling_period=1e-5",
        "feedforward=rbf",
        "feedforward.centres=4000",
    ): "feedforward.centres=4000: needs about 48.4 "
    "GB with 300000 steps a cycle, but there are 2.0 GB: take a smaller one, or a larger sampling_period",
}


@pytest.mark.parametrize("overrides", NEEDS, ids=" ".join)
def test_what_needs_more_memory_than_there_is_is_refused(make_config, monkeypatch, overrides):
    monkeypatch.setattr(memory, "available_memory", lambda: 2e9)
    with pytest.raises(BadInput) as raised:
        make_config(*RUN, *overrides)
    assert str(raised.value) == NEEDS[overrides]


@pytest.mark.parametrize(
    ("more", "copies"), [((), 0), (("record.weights=true",), 4), (("learning.start_from=a",), 8)]
)
def test_copies_of_the_weights_count(make_config, more, copies):
    config = make_config("scenario=quadruped", "cmac.memory_bytes=1000000000", *more)
    needed, component = estimate_memory(config)
    assert needed // 1e9 == component.bytes // 1e9 == copies
    assert component.key == ("cmac.memory_bytes" if copies else "cmac.layers")


@pytest.mark.parametrize(("layers", "moving"), [(1, True), (20, True), (20, False)])
def test_weights_that_learn_at_neighbouring_steps_take_at_most_what_is_estimated(layers, moving):
    """All cells change at every step, or none does."""
    row = np.arange(400)[:, None, None] * moving * layers + np.arange(layers)
    cells = row.astype(np.uint32)
    spread_shares(cells, np.ones(cells.shape), 40)
    peak = measure_peak(lambda: spread_shares(cells, np.ones(cells.shape), 40))
    assert peak * 0.9 < spread.estimate_memory(cells, 40) < peak * 1.6


def test_a_window_that_needs_more_memory_than_there_is_is_refused(make_config, monkeypatch):
    config = make_config(*RUN, "feedforward=ilc", "learning.rule=zero_phase", "learning.window=100")
    monkeypatch.setattr(spread, "available_memory", lambda: 1e6)
    with pytest.raises(BadInput) as raised:
        make_scenario(config)
    assert str(raised.value) == (
        "learning.window=100: needs about 0.0 GB with 600 steps a cycle, but there are 0.0 GB: take a smaller one, "
        "or a larger sampling_period"
    )


def test_a_control_group_limits_the_memory(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "GROUPS", tmp_path)
    machine = available_memory()
    assert 1e8 < machine < 1e15
    (tmp_path / "memory.max").write_text("max\n")
    assert available_memory() == machine
    (tmp_path / "memory.max").write_text("1000000\n")
    assert available_memory() == 1e6
