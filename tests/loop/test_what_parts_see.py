"""What the parts of a loop know: the plant what is true, all others what the designer believes, and what they see."""

from dataclasses import replace

import numpy as np
import pytest
from support.doors import make_scenario, roll_out

from cmacexp.control import HybridController
from cmacexp.loop.builtin import find_external
from cmacexp.plants import AnalyticPlant

SHORT = ("gait.cycle_time=0.2", "gait.lift=0.005")
"""A cycle of 40 samples."""


class Witness:
    """A feedforward that keeps all that it is shown."""

    acts = True

    def reset(self, setup):
        self.config, self.seen = setup.config, []

    def observe(self, reference, measurement, torque):
        self.seen.append((reference.step, measurement, torque))

    def predict(self, reference, learning_error):
        assert self.seen[-1][0] == reference.step
        return np.full((1, 2), 0.1)


class Own(HybridController):
    """A controller that no loop knows."""


@pytest.mark.parametrize("controller", [HybridController, Own])
def test_a_feedforward_that_asks_for_it_is_shown_every_step(make_config, controller):
    config = make_config("cycles=2", *SHORT, "sensors=real")
    witness, own = Witness(), controller(config.controller)
    columns = roll_out(make_scenario(config, feedforward=witness, controller=own)).columns()
    assert [step for step, _, _ in witness.seen] == list(range(80))
    applied = np.stack([columns[f"tau_feedback_{j}"] + columns[f"tau_feedforward_{j}"] for j in (1, 2)], axis=2)
    np.testing.assert_array_equal([torque for _, _, torque in witness.seen], [np.zeros((1, 2)), *applied[:-1]])
    np.testing.assert_array_equal([shown.force for _, shown, _ in witness.seen], columns["force_measured"])


def test_a_subclass_is_called_in_every_step_with_the_same_bits(make_config):
    class Called(AnalyticPlant):
        pass

    config = make_config("cycles=1", *SHORT)
    called, compiled = (make_scenario(config, plant=plant(config.plant)) for plant in (Called, AnalyticPlant))
    assert (find_external(called).plant, find_external(compiled).plant) == (True, False)
    np.testing.assert_array_equal(roll_out(called).samples, roll_out(compiled).samples)


def test_the_plant_alone_gets_what_is_true(make_config):
    class Plant(AnalyticPlant):
        def reset(self, setup):
            self.known = setup.config
            return super().reset(setup)

    unknown = ("terrain.patch_spread=0.2", "terrain.slope=0.01", "plant.mass_factor=1.1", "terrain.step_time=0.1")
    config = make_config(*SHORT, *unknown, "terrain.assumed_stiffness=9000", "terrain.step_factor=2", "cycles=1")
    witness, plant = Witness(), Plant(config.plant)
    make_scenario(config, feedforward=witness, plant=plant)
    assert plant.known == config
    nominal = make_config(*SHORT, "terrain.stiffness=9000", "terrain.assumed_stiffness=9000", "cycles=1")
    assert replace(witness.config, plant=None) == replace(nominal, plant=None)
    assert witness.config.plant == {"_target_": "cmacexp.plants.AnalyticPlant"}


def test_masses_and_start_of_the_plant_alone_are_others(make_config):
    spread = ("plant.mass_factor=2", "plant.start_spread=0.05", "plant.start_seed=3")
    scenario = make_scenario(make_config(*SHORT, *spread))
    believed, built = (part.params.mechanism.legs for part in (scenario.controller, scenario.plant))
    np.testing.assert_array_equal(built, believed * [1.0, 1.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    off = np.abs(scenario.plant.state.q - scenario.setup.start)
    assert 0.0 < off.min() <= off.max() <= 0.05
