"""Robots in the config: settings by rule are numbers that follow what they depend on and that anyone can override."""

import re

import pytest
from omegaconf import OmegaConf
from support.doors import BadInput, CmacexpError, LoopDelay, derive_basis, derive_gains, discretise, recommend_period
from support.robots import FEET, MODELS, OWN, change, read

from cmacexp.config import config_folder, to_config, to_plain
from cmacexp.config.compose import compose_config, compose_untyped
from cmacexp.config.explain import explain_composition
from cmacexp.config.machine import describe_other_model
from cmacexp.config.robot_rule import READ, rule_value

pytestmark = pytest.mark.ci
ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}")
KEYS = (
    *("controller.position_gain", "controller.velocity_gain", "posture.gain", "posture.rate_gain"),
    *("force_control.elasticity", "force_control.admittance"),
)
"""What the rule gives, in its order."""
LATE = ("sensors=encoders", "actuator.delay=1", "actuator.lag=0.001", "sensors.position.delay=9")


def settings(config):
    return [OmegaConf.select(OmegaConf.create(to_plain(config)), key) for key in KEYS]


@pytest.mark.parametrize(
    ("overrides", "loop_delay"),
    [
        ((), LoopDelay()),
        (("sampling_period=0.001",), LoopDelay()),
        (("controller.lead_alpha=2",), LoopDelay()),
        (LATE, LoopDelay(2, (0.001,))),
        (("actuator.delay=1", "machine.latency=0.0007"), LoopDelay(1, (), 0.0007)),
    ],
)
def test_settings_follow_model_period_lead_and_what_delays_the_velocity(overrides, loop_delay):
    config = compose_config([*ROBOT, *overrides])
    basis, control, period = derive_basis(read()), config.controller, config.sampling_period
    assert period == (0.001 if "sampling_period=0.001" in overrides else recommend_period(basis.ratio, loop_delay))
    lead = discretise(control.lead_omega, control.lead_alpha, period)
    assert settings(config) == pytest.approx(derive_gains(basis, period, lead.b0, loop_delay), rel=1e-5)
    assert config.terrain.stiffness == pytest.approx(basis.stiffness, rel=1e-5)
    assert config.machine.hip_height == pytest.approx(basis.hip_height, rel=1e-5)


def test_settings_are_numbers_in_the_manifest_and_typed_again_they_stay():
    config = compose_config(ROBOT)
    plain = to_plain(config)
    assert "rule:" not in str(plain)
    assert to_config(OmegaConf.create(plain)) == config


@pytest.mark.parametrize("overrides", [LATE, ("controller=drives", "gait=trot", "gait.speed=0.4")])
def test_rules_read_only_what_is_declared_to_be_read(overrides):
    """Numbers in other groups are set alone, without the rules being asked again."""
    config, _ = compose_untyped([*ROBOT, *overrides])
    names = re.findall(r"\$\{rule:(\w+)", str(OmegaConf.to_container(config)))
    alone = OmegaConf.masked_copy(config, sorted(READ))
    assert len(names) > 10
    assert [rule_value(name, alone) for name in names] == [rule_value(name, config) for name in names]


def test_one_setting_is_overridden_and_the_others_stay():
    by_rule, other = compose_config(ROBOT), compose_config([*ROBOT, "controller.position_gain=77"])
    assert settings(other) == [77.0, *settings(by_rule)[1:]]


def test_a_period_too_long_for_gains_by_rule_is_allowed_if_all_are_given():
    config = compose_config([*ROBOT, "sampling_period=0.005", *(f"{key}=1" for key in KEYS)])
    assert settings(config) == [1.0] * 6


def test_mistakes_are_said_where_a_config_is_shown_or_read(tmp_path):
    """Shown as by ``--cfg job --resolve``, which resolves what Hydra composed, and nothing more."""
    composed, _ = compose_untyped([*ROBOT, "machine.path=no.xml"])
    with pytest.raises(Exception, match="no such file") as raised:
        OmegaConf.to_yaml(composed, resolve=True)
    assert explain_composition(raised.value, []).startswith("machine.path=no.xml: ")
    plain = to_plain(compose_config(ROBOT))
    plain["machine"]["path"] = str(change(tmp_path, "<mujoco", "<html"))
    with pytest.raises(BadInput, match=r"^machine\.path="):
        to_config(OmegaConf.create(plain))


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ["machine=a/b.urdf"],
            r"machine=a/b\.urdf: is no option; for a file use machine=mjcf machine\.path=a/b\.urdf",
        ),
        (["gait.width=-0.1"], r"gait\.width=-0\.1: must be above 0"),
        (["machine.width=-0.1"], r"machine\.width=-0\.1: is that of gait\.width"),
    ],
)
def test_mistakes_are_said_where_they_were_made(overrides, message):
    with pytest.raises(CmacexpError, match=f"^{message}"):
        compose_config([*ROBOT, *overrides])


def test_heavy_feet_are_warned_of_a_long_period(tmp_path):
    heavy = change(tmp_path, 'mass="0.05"', 'mass="0.9"')
    config = compose_config([*ROBOT, f"machine.path={heavy}"])
    assert config.sampling_period == 0.002
    assert "with a sampling_period above 0.001 it may fall" in describe_other_model(config.machine)
    assert not describe_other_model(compose_config(ROBOT).machine)


OPTIONS = {path.stem for path in (config_folder() / "machine").glob("*.yaml")}


@pytest.mark.parametrize("name", sorted(OPTIONS & set(MODELS)))
def test_every_robot_has_a_config_and_the_model_that_it_was_measured_with(name):
    config = compose_config(["scenario=robot", f"machine={name}"])
    assert (config.machine.model, config.machine.feet) == (name, list(FEET))
    assert config.machine.fingerprint
    assert not describe_other_model(config.machine)
    assert config.sampling_period in (0.001, 0.002)
    assert min(*config.gains, *settings(config)[2:5]) > 0.0
