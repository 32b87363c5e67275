"""Laws of the loop with external components: that a component is external changes no bit of a run."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from support.doors import make_scenario
from support.rollout import roll_out

CALLED = {"sensors": "measure", "controller": "act", "feedforward": "predict", "plant": "step"}


class External:
    """Does what a built-in component does, and counts its calls."""

    def __init__(self, component):
        self.component, self.calls = component, dict.fromkeys(CALLED.values(), 0)

    def __getattr__(self, name):
        inner = getattr(self.component, name)
        if name not in CALLED.values():
            return inner

        def counted(*arguments):
            self.calls[name] += 1
            return inner(*arguments)

        return counted


@pytest.mark.parametrize(
    ("scenario", "groups"),
    [
        *(("one_leg", (group,)) for group in CALLED),
        ("quadruped", ("sensors", "plant")),
        ("quadruped", ("feedforward",)),
        ("quadruped", tuple(CALLED)),
    ],
    ids=str,
)
def test_a_run_has_the_same_bits_whichever_components_are_external(make_config, scenario, groups):
    sensors = ("sensors=real", "sensors.position.bias=1e-3", "sensors.force.bias=0.1")
    short = ("gait.cycle_time=0.2", "gait.lift=0.005", "cycles=3", "learning.start_cycle=2")
    config = make_config(f"scenario={scenario}", *short, *sensors)
    built_in, inside = roll_out(make_scenario(config)), make_scenario(config)
    external = {group: External(getattr(inside, group)) for group in groups}
    mixed, steps = roll_out(dataclasses.replace(inside, **external)), len(built_in.samples)
    assert steps == (120 if scenario == "one_leg" else 42)  # four legs cannot walk so fast: they fall
    assert mixed.status == built_in.status
    assert_array_equal(mixed.samples, built_in.samples)
    assert_array_equal(mixed.body_samples, built_in.body_samples)
    assert np.abs(mixed.columns()["tau_feedforward_1"][41:]).max() > 0.0
    for group, component in external.items():
        asked = steps
        if group == "feedforward":  # not before it acts; and a controller calls the one that it was given
            asked = 0 if "controller" in groups else steps - 40
        assert component.calls[CALLED[group]] == asked
