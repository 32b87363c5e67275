"""Robots in the config: settings by rule are numbers that follow what they depend on and that anyone can override."""

import pytest
from omegaconf import OmegaConf
from support.robots import FEET, MODELS, OWN, change, read

from cmacexp.config import config_folder, to_config, to_plain
from cmacexp.config.compose import compose_config, compose_untyped
from cmacexp.config.explain import explain_composition
from cmacexp.errors import BadInput
from cmacexp.models.lateness import Lateness
from cmacexp.models.lead import discretise
from cmacexp.models.robot_gains import derive_basis, derive_gains, recommend_period

ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}")


def settings(config):
    """What the rule gives, in the order of Gains."""
    control, posture, force = config.controller, config.posture, config.force_control
    gains = control.position_gain, control.velocity_gain, posture.gain, posture.rate_gain
    return [*gains, force.elasticity, force.admittance]


@pytest.mark.parametrize("overrides", [(), ("sampling_period=0.001",), ("controller.lead_alpha=2",)])
def test_settings_follow_model_period_and_lead(overrides):
    config = compose_config([*ROBOT, *overrides])
    basis, control = derive_basis(read()), config.controller
    lead = discretise(control.lead_omega, control.lead_alpha, config.sampling_period)
    assert settings(config) == pytest.approx(derive_gains(basis, config.sampling_period, lead.b0), rel=1e-5)
    assert config.terrain.stiffness == pytest.approx(basis.stiffness, rel=1e-5)
    assert config.machine.hip_height == pytest.approx(basis.hip_height, rel=1e-5)


def test_settings_count_what_delays_the_feedback_of_the_velocity():
    late = ("sensors=encoders", "actuator.delay=1", "actuator.lag=0.001", "sensors.position.delay=9")
    config = compose_config([*ROBOT, *late])
    lateness = Lateness(2, (0.001,))
    period = recommend_period(derive_basis(read()).ratio, lateness)
    lead = discretise(config.controller.lead_omega, config.controller.lead_alpha, period)
    assert config.sampling_period == period
    assert settings(config) == pytest.approx(derive_gains(derive_basis(read()), period, lead.b0, lateness), rel=1e-5)
    with pytest.raises(BadInput, match=r"^actuator\.lag=-1: must be a number of at least 0, from which others"):
        compose_config([*ROBOT, "actuator.lag=-1"])


def test_settings_are_numbers_in_the_manifest_and_typed_again_they_stay():
    config = compose_config(ROBOT)
    plain = to_plain(config)
    assert "rule:" not in str(plain)
    assert to_config(OmegaConf.create(plain)) == config


def test_one_setting_is_overridden_and_the_others_stay():
    by_rule, other = compose_config(ROBOT), compose_config([*ROBOT, "controller.position_gain=77"])
    assert other.controller.position_gain == 77.0
    assert settings(other)[1:] == settings(by_rule)[1:]


def test_a_period_too_long_is_refused_unless_all_gains_are_given():
    long = [*ROBOT, "sampling_period=0.005"]
    with pytest.raises(BadInput, match=r"^sampling_period=0\.005: is too long, .*: use 0\.002, or set gains$"):
        compose_config(long)
    keys = ("controller.position_gain", "controller.velocity_gain", "posture.gain", "posture.rate_gain")
    more = ("force_control.elasticity", "force_control.admittance")
    assert settings(compose_config([*long, *(f"{key}=1" for key in (*keys, *more))])) == [1.0] * 6


def test_a_controller_without_a_compensator_has_gains_as_without_lead():
    found = compose_untyped([*ROBOT, "~controller.lead_omega", "~controller.lead_alpha"])[0]
    gains = derive_gains(derive_basis(read()), 0.002, 1.0)
    assert found.controller.velocity_gain == pytest.approx(gains.velocity_gain, rel=1e-5)


def test_a_mistake_is_said_where_a_config_is_only_shown():
    """As by ``--cfg job --resolve``, which resolves what Hydra composed, and nothing more."""
    composed, _ = compose_untyped([*ROBOT, "machine.path=no.xml"])
    with pytest.raises(Exception, match="no such file") as raised:
        OmegaConf.to_yaml(composed, resolve=True)
    said = explain_composition(raised.value, [])
    assert said == "machine.path=no.xml: there is no such file; give the path of an MJCF or URDF file"


def test_a_model_is_checked_though_nothing_follows_from_it(tmp_path):
    plain = to_plain(compose_config(ROBOT))
    plain["machine"]["path"] = str(change(tmp_path, "<freejoint/>", ""))
    with pytest.raises(BadInput, match=r"^machine\.path=.*: has no free joint"):
        to_config(OmegaConf.create(plain))


OPTIONS = {path.stem: OmegaConf.load(path) for path in (config_folder() / "machine").glob("*.yaml")}


@pytest.mark.parametrize("name", sorted(set(OPTIONS) & set(MODELS)))
def test_every_robot_has_a_config(name):
    config = compose_config(["scenario=robot", f"machine={name}"])
    assert config.machine.model == name
    assert config.machine.feet == list(FEET)
    assert config.sampling_period in (0.001, 0.002)
    assert min(*config.gains, config.posture.gain, config.posture.rate_gain, config.force_control.elasticity) > 0.0
