"""Legs of their own and ground in patches reach the machine as they are configured."""

import dataclasses

import pytest
from numpy.testing import assert_array_equal
from support.grounds import still_ground

from cmacexp.loop.scenario import make_scenario
from cmacexp.planning.machine import make_mechanism

# Legs of their own


def legs_of(config):
    return dataclasses.asdict(config.machine)["legs"]


def test_what_is_set_for_all_legs_goes_to_all_of_them_but_those_with_their_own(make_config):
    legs = legs_of(make_config("scenario=quadruped", "machine.leg.mass_1=0.6", "machine.legs.right_rear.mass_1=0.7"))
    assert [leg["mass_1"] for leg in legs.values()] == [0.6, 0.6, 0.6, 0.7]
    assert [leg["mass_2"] for leg in legs.values()] == [0.5] * 4


def test_legs_of_their_own_have_their_own_hips_links_and_knees(make_config):
    own = ["length_1=0.3", "length_2=0.4", "hip_x=0.25", "hip_y=-0.2", "knee=back", "mass_2=0.4"]
    config = make_config("scenario=quadruped", *(f"machine.legs.right_front.{value}" for value in own))
    mechanism = make_mechanism(config.machine)
    assert_array_equal(mechanism.legs[1], [0.3, 0.4, 0.5, 0.4, -1.0])
    assert_array_equal(mechanism.hips[1], [0.25, -0.2])
    assert_array_equal(mechanism.legs[[0, 2, 3], 4], [1.0, -1.0, -1.0])


@pytest.mark.parametrize("override", ["length_1=0.4", "mass_1=0.8", "mass_2=0.3"])
def test_planned_joints_and_torques_of_the_other_legs_stay_as_they_are(make_config, override):
    plain, changed = (
        make_scenario(make_config("scenario=quadruped", "feedforward=inverse_dynamics", *overrides))
        for overrides in ([], [f"machine.legs.left_front.{override}"])
    )
    differs = [
        (one != other).any(axis=(0, 2)).tolist()
        for one, other in (
            (plain.setup.plan.joints, changed.setup.plan.joints),
            (plain.feedforward.params.torque, changed.feedforward.params.torque),
        )
    ]
    assert differs == [[override.startswith("length"), False, False, False], [True, False, False, False]]
    assert_array_equal(plain.setup.plan.force_desired, changed.setup.plan.force_desired)


# Ground in patches


def test_the_ground_of_a_scenario_is_that_of_its_config(make_config):
    scenario = make_scenario(make_config("scenario=quadruped", "terrain=patchy", "terrain.patch_seed=9"))
    assert scenario.plant.params.ground == still_ground(1e4, 0.15, 0.5, 9)
