"""Names that a config can choose and the tables of what they stand for agree."""

from dataclasses import fields

import pytest
from omegaconf import OmegaConf
from support.robots import OWN

from cmacexp.cmac.addressing import DISPLACEMENTS
from cmacexp.cmac.receptive_field import RECEPTIVE_FIELDS
from cmacexp.config import config_folder
from cmacexp.config.cmac import INPUTS, PHASE, CmacConfig
from cmacexp.config.gait import PATTERNS, GaitConfig
from cmacexp.config.schema import ForceControlConfig
from cmacexp.control.hybrid_kernels import METHODS
from cmacexp.feedforward import RadialBasis
from cmacexp.planning import columns
from cmacexp.planning.columns import JOINT_COLUMNS
from cmacexp.planning.gait import compute_touch_downs
from cmacexp.sensors.channel import FAULTS
from cmacexp.sensors.config import FaultConfig

CHOICES = [
    (ForceControlConfig, "method", METHODS),
    (CmacConfig, "displacement", DISPLACEMENTS),
    (CmacConfig, "receptive_field", RECEPTIVE_FIELDS),
    (CmacConfig, "inputs", (*JOINT_COLUMNS, PHASE)),
    (RadialBasis.Config, "inputs", INPUTS),
    (FaultConfig, "kind", FAULTS),
    (GaitConfig, "pattern", PATTERNS),
]


@pytest.mark.parametrize(("config", "name", "table"), CHOICES)
def test_a_field_and_the_table_of_its_choices_have_the_same_names(config, name, table):
    (field,) = [each for each in fields(config) if each.name == name]
    assert list(field.metadata["choices"]) == list(table)


@pytest.mark.parametrize("name", PATTERNS)
def test_a_gait_has_options_with_which_it_is_valid(name, make_config):
    pattern = PATTERNS[name]
    scenario = "scenario=quadruped" if pattern.legs == 4 else "scenario=force_step"
    robot = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}") if pattern.is_dynamic else (scenario,)
    options = [path.stem for path in (config_folder() / "gait").glob("*.yaml")]
    found = [
        option for option in options if OmegaConf.load(config_folder() / f"gait/{option}.yaml").get("pattern") == name
    ]
    assert found
    for option in found:
        config = make_config(*robot, f"gait={option}")
        assert config.legs == pattern.legs
        phases = compute_touch_downs(name, config.gait.duty_factor)
        assert len(phases) == pattern.legs
        assert all(0.0 <= phase < 1.0 for phase in phases)


REFERENCE = ("X", "Y", "VX", "VY", "FORCE_REFERENCE", "FORCE_ADDED", "FORCE_DESIRED")
MOTION = ("X", "Y", "VX", "VY", "AX", "AY")


@pytest.mark.parametrize(
    ("count", "plane", "space"),
    [
        (columns.REFERENCE_COLUMNS, REFERENCE, ("REFERENCE_Z", "REFERENCE_VZ")),
        (columns.MOTION_COLUMNS, MOTION, ("Z", "VZ", "AZ")),
        (columns.MOTION_COLUMNS, ("Q1", "Q2", "DQ1", "DQ2", "DDQ1", "DDQ2"), ("Q3", "DQ3", "DDQ3")),
    ],
)
def test_every_column_of_a_plan_has_a_name_and_no_two_the_same(count, plane, space):
    for axes, names in ((2, plane), (3, plane + space)):
        assert sorted(getattr(columns, name) for name in names) == list(range(count[axes]))
    assert set(count) == {2, 3}
