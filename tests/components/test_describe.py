"""What is declared of config fields, as reports show it."""

import pytest

from cmacexp.config.compose import compose_config
from cmacexp.config.describe import describe_fields, read_defaults
from cmacexp.config.difference import flat
from cmacexp.config.load import to_plain

CHOICES = (
    ("scenario=one_leg", "feedforward=rbf", "sensors=real"),
    ("scenario=one_leg", "feedforward=ilc"),
    ("scenario=quadruped", "feedforward=inverse_dynamics"),
    ("scenario=quadruped", "plant=mujoco_quadruped", "feedforward=rbf"),
    ("scenario=force_step",),
)


@pytest.mark.parametrize("overrides", CHOICES)
def test_every_field_says_what_it_means(overrides):
    config = to_plain(compose_config(overrides))
    described = describe_fields(config)
    assert set(described) >= set(flat(config))
    assert not [key for key, field in described.items() if not field.meaning]


def test_unit_and_meaning_are_those_beside_the_field():
    described = describe_fields(to_plain(compose_config(["scenario=quadruped"])))
    assert described["machine.legs.left_rear.length_1"] == ("m", "Hip to knee, l1.")
    assert described["sampling_period"] == ("s", "Time between two steps of the loop, T_s.")


def test_a_class_that_is_not_here_leaves_its_fields_undescribed():
    config = to_plain(compose_config([])) | {"plant": {"_target_": "nowhere.Plant", "size": 1}}
    described = describe_fields(config)
    assert not [key for key in described if key.startswith("plant")]
    assert described["cycles"].meaning


def test_defaults_are_those_of_the_scenario():
    assert read_defaults("quadruped")["controller.position_gain"] == 50.0
    assert read_defaults("one_leg")["controller.position_gain"] != 50.0
    assert read_defaults("nowhere") == {}
