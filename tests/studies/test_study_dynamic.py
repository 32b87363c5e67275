"""The study of a body with mass: measures by hand, walks that differ in one change, a message without MuJoCo."""

from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from support.command import python

from cmacexp.config.compose import compose_config
from pipelines.dynamic_body import (
    ALL,
    CHANGES,
    CMAC,
    FEEDBACK,
    NAMES,
    NONE,
    low_passed,
    off_course,
    runs,
    slow_force,
    without,
    yaw,
)


def test_slow_errors_pass_and_fast_ones_do_not():
    time = np.arange(0.0, 3.0, 0.002)[:, None]
    for frequency, passes in ((1.0, 1.0), (10.0, 0.5), (100.0, 0.0)):
        wave = np.sin(2.0 * np.pi * frequency * time)
        middle = slice(500, 1000)
        assert np.ptp(low_passed(wave, 0.002)[middle]) / np.ptp(wave[middle]) == pytest.approx(passes, abs=0.02)


class Walk:
    """What is read of a stored run: two legs, one cycle; one force is 3 N too large, the body is 1 % too slow."""

    def __init__(self, status: str = "completed"):
        self.status = status
        gait = {"stroke": 0.15, "duty_factor": 0.75, "cycle_time": 2.0}
        self.config = {"cycles": 4, "sampling_period": 0.002, "gait": gait}

    def cycles(self, numbers, name="trace.parquet"):
        assert numbers == [4]
        time = 0.002 * np.arange(1000)
        if name == "trace.parquet":
            force = np.tile([10.0, 13.0], len(time))
            return pd.DataFrame({"time": time.repeat(2), "leg": [1, 2] * 1000, "force": force, "force_desired": 10.0})
        return pd.DataFrame({"cog_x": 0.099 * time, "yaw": -0.05 * time / time[-1]})


def test_measures_are_of_the_last_cycle():
    assert slow_force(Walk()) == pytest.approx(3.0 / 2**0.5)
    assert off_course(Walk()) == pytest.approx(0.01)
    assert yaw(Walk()) == pytest.approx(0.05)


@pytest.mark.parametrize("measure", [slow_force, off_course, yaw])
def test_a_walk_that_fell_is_infinitely_wrong(measure):
    assert measure(Walk("fell")) == np.inf


def flat(part: str, walk: str, feedforward: str = CMAC) -> dict[str, str]:
    """The overrides of a walk."""
    wanted = {"part": part, "walk": walk, "feedforward": feedforward}
    (request,) = [r for r in runs(quick=False) if wanted.items() <= r.labels.items()]
    return dict(text.split("=", 1) for text in request.overrides)


def test_every_change_is_left_out_once_and_no_two_set_the_same():
    for name, texts in CHANGES.items():
        assert flat("left out", without(name)) == flat("left out", ALL) | dict(t.split("=", 1) for t in texts)
    keys = [{text.partition("=")[0] for text in texts} for texts in CHANGES.values()]
    assert not any(one & other for one, other in combinations(keys, 2))
    assert flat("made", f"+ {NAMES[-1]}") == flat("left out", ALL)
    assert flat("made", NONE).keys() - flat("left out", ALL).keys() == set().union(*keys)


@pytest.mark.parametrize("name", NAMES)
def test_a_change_is_one_and_feedback_alone_walks_on_the_same_plan(name):
    def config(walk, kind):
        return compose_config([f"{key}={value}" for key, value in flat("left out", walk, kind).items()])

    learnt, felt = (config(without(name), kind) for kind in (CMAC, FEEDBACK))
    assert learnt != config(ALL, CMAC)
    same = ("gait", "force_control", "posture", "terrain", "controller", "sampling_period", "reference", "plant")
    assert all(getattr(learnt, part) == getattr(felt, part) for part in same)


def test_without_mujoco_it_says_how_to_install_it(tmp_path):
    (tmp_path / "mujoco.py").write_text("raise ImportError('not here')\n")
    command = ["-m", "pipelines.dynamic_body", "--quick", "--folder", "studies"]
    done = python(*command, folder=tmp_path, LC_ALL="C.UTF-8")  # a process of its own, which ends as any other
    assert done.returncode == 2
    assert done.stderr == 'error: plant=mujoco: MuJoCo is not installed: python -m pip install -e ".[mujoco]"\n'
    assert not (tmp_path / "studies" / "runs").exists()
