"""The page of config fields has every field with its meaning; other pages name only fields that exist."""

import re
import runpy

import pytest
from support.command import ROOT
from support.pages import PAGES
from support.robots import OWN

from cmacexp.config import schema

TABLES = runpy.run_path(str(ROOT / "docs" / "config_tables.py"))
CONFIGS = (
    ["scenario=one_leg", "feedforward=rbf"],
    ["scenario=quadruped", "sensors=real", "feedforward=ilc"],
    ["scenario=quadruped", "plant=mujoco_quadruped", "feedforward=rbf"],
    ["scenario=force_step"],
    ["scenario=one_leg", "feedforward=inverse_dynamics"],
    ["scenario=robot", "machine=mjcf", f"machine.path={OWN}"],
)
"""Together they have every field."""


@pytest.fixture(scope="module")
def rows(make_config):
    """The rows of all fields, by their keys."""
    return {row.key: row for overrides in CONFIGS for row in TABLES["rows_of"](make_config(*overrides), "")}


def test_every_class_of_a_config_is_among_them(rows):
    declared = {each for each in vars(schema).values() if isinstance(each, type) and each.__name__.endswith("Config")}
    assert declared - {row.schema for row in rows.values()} == set()


def test_unit_range_and_defaults_stand_beside_a_field():
    text = TABLES["section_of"]("terrain")
    row = "| `terrain.patch_size` | m | at least 0.001 | `1.0`; `terrain=patchy`: `0.15` |"
    assert row in text


@pytest.mark.parametrize("name", PAGES)
def test_the_fields_that_a_page_names_exist(name, rows):
    """Whatever looks like a field of a group."""
    spans = re.findall(r"`([a-z_]+(?:\.[a-z_0-9]+)+)(?:=[^`]*)?`", PAGES[name].read_text())
    named = {span for span in spans if span.partition(".")[0] in TABLES["GROUPS"] and not span.endswith("._target_")}
    general = {re.sub(r"^(sensors|machine\.legs)\.\w+", r"\1.NAME", span) for span in named - set(rows)}
    assert general - set(rows) == set()
