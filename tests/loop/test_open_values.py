"""Values that the paper leaves open: what each of their fields changes in a run."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import make_scenario, roll_out

LEG = ("scenario=one_leg", "cmac.addressing=visited", "gait.cycle_time=0.5")


@pytest.fixture
def run_leg(make_config):
    def run(*overrides, cycles=2):
        scenario = make_scenario(make_config(*LEG, f"cycles={cycles}", *overrides))
        return scenario, {name: values[:, 0] for name, values in roll_out(scenario).columns().items()}

    return run


def test_without_gravity_feedback_only_presses_with_the_desired_force(make_config):
    config = make_config("scenario=one_leg", "cycles=1", "plant.gravity_factors=[0,0,0,0]")
    force = roll_out(make_scenario(config)).columns()["force"][-200:, 0]
    assert force.mean() == pytest.approx(1.0, abs=0.01)


def test_a_model_with_the_gravity_of_the_plant_leaves_less_feedback(run_leg):
    gravity = "gravity_factors=[0,-1,-1,1]"
    own = ("feedforward=inverse_dynamics", f"plant.{gravity}", "gait.vertical=two_cubics", "gait.cycle_time=3")
    feedback = [
        np.abs(run_leg(*own, f"feedforward.gravity_factors={factors}", cycles=1)[1]["tau_feedback_1"]).mean()
        for factors in ("[1,1,1,1]", "[0,-1,-1,1]")
    ]
    assert feedback[1] < 0.2 * feedback[0]


def test_the_lead_starts_from_zero_at_a_change_of_phase_if_asked(run_leg):
    kept, reset = (run_leg(f"controller.lead_reset={flag}")[1] for flag in ("false", "true"))
    change = 20  # touch-down of the first cycle
    assert_array_equal(kept["tau_feedback_1"][:change], reset["tau_feedback_1"][:change])
    assert kept["tau_feedback_1"][change] != reset["tau_feedback_1"][change]


def test_force_terms_act_in_planned_transfer_if_they_switch_by_contact(run_leg):
    plan, contact = (run_leg(f"force_control.switch={switch}")[1] for switch in ("plan", "contact"))
    assert plan["force"][0] > 0.0
    assert plan["tau_feedback_1"][0] != contact["tau_feedback_1"][0]


def test_the_transfer_starts_at_the_depth_that_is_asked_for(run_leg):
    for depth in (0.0, 1.5):
        scenario, _ = run_leg(f"gait.transfer_depth={depth}")
        assert scenario.setup.plan.desired.position[0, 0, 1] == pytest.approx(0.5 + 0.1 * depth)


@pytest.mark.parametrize(("kind", "steps"), [("int8", 2**8), ("int16", 2**16)])
def test_weights_are_whole_numbers_of_steps_within_their_limit(run_leg, kind, steps):
    scenario, _ = run_leg(f"cmac.weight_type={kind}", "cmac.weight_limit=0.1")
    weights = scenario.feedforward.learnt()["weights"]
    numbers = weights / (0.2 / steps)
    assert abs(numbers).max() > 1.0
    assert_allclose(numbers, np.rint(numbers), atol=1e-9)
    assert -steps / 2 <= numbers.min() <= numbers.max() <= steps / 2 - 1
