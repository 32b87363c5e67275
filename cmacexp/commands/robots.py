"""``python -m cmacexp.robots go1``: what the model of a robot holds, and what follows from it by rule."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cmacexp.commands.command import Parser, run_command
from cmacexp.config import Config, config_folder, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.config.describe import describe_fields
from cmacexp.config.difference import flat
from cmacexp.config.machine import read_model
from cmacexp.errors import BadInput, suggest
from cmacexp.metrics.text import format_number
from cmacexp.models.robot import Robot
from cmacexp.models.robot_gains import derive_basis
from cmacexp.report.terminal import say
from cmacexp.report.terminal_tables import print_table
from cmacexp.typing import Array

SETTINGS = (
    "sampling_period",
    "controller.position_gain",
    "controller.velocity_gain",
    "controller.lead_omega",
    "controller.lead_alpha",
    "posture.gain",
    "posture.rate_gain",
    "force_control.elasticity",
    "force_control.admittance",
    "terrain.stiffness",
    "terrain.damping",
    "machine.hip_height",
    "gait.stroke",
    "gait.lift",
    "gait.cycle_time",
    "gait.duty_factor",
)
"""Fields of the config that follow from the model, and those beside which they are read."""


def _choose(robot: str) -> list[str]:
    """Overrides that choose a robot by the name of its option, or by its file."""
    names = [path.stem for path in (config_folder() / "machine").glob("*.yaml")]
    if robot in names:
        return [f"machine={robot}"]
    if not Path(robot).is_file():
        raise BadInput("machine", robot, f"must be an option of conf/machine or an MJCF file{suggest(robot, names)}")
    quoted = str(Path(robot).resolve()).replace("'", "\\'")
    return ["machine=mjcf", f"machine.path='{quoted}'"]


def joint_rows(robot: Robot) -> list[list[str]]:
    """Rows of a table: what the model says of hip, thigh and calf, each with its unit."""

    def row(name: str, unit: str, values: Array) -> list[str]:
        return [name, unit, *(format_number(float(value)) for value in values)]

    return [
        row("largest torque", "N m", robot.torque_limits),
        row("dry friction", "N m", robot.friction),
        row("damping", "N m s/rad", robot.damping),
        row("inertia of the rotor", "kg m^2", robot.armature),
        row("least angle, all legs", "rad", robot.ranges[..., 0].max(axis=0)),
        row("largest angle, all legs", "rad", robot.ranges[..., 1].min(axis=0)),
    ]


def setting_rows(config: Config, keys: Sequence[str] = SETTINGS) -> list[list[str]]:
    """Rows of a table: fields of the config, each with its unit."""
    plain = to_plain(config)
    values, described = flat(plain), describe_fields(plain)
    return [[key, described[key].unit, format_number(values[key])] for key in keys if key in values]


def _show(arguments: argparse.Namespace) -> int:
    config = compose_config(["scenario=robot", *_choose(arguments.robot), *arguments.overrides])
    robot = read_model(config.machine)
    basis = derive_basis(robot)
    length_1, length_2 = robot.links
    say(str(robot.path))
    print(f"mass {format_number(basis.mass, 'kg')}, links {length_1:.3g} m and {length_2:.3g} m")
    print(f"a foot feels {format_number(basis.foot_mass, 'kg')} at least, {basis.ratio:.3g} of the mass")
    print_table(["", "unit", "hip", "thigh", "calf"], joint_rows(robot))
    print_table(["", "unit", "value"], setting_rows(config))
    return 0


def main() -> int:
    """Run the command."""
    description = "Show what the model of a robot holds, and the settings that follow from it by rule."
    parser = Parser("cmacexp.robots", description)
    parser.add_argument("robot", metavar="ROBOT", help="go1 or another option of conf/machine, or an MJCF file")
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help="overrides as of python -m cmacexp")
    return run_command(lambda: _show(parser.parse_args()))


if __name__ == "__main__":
    sys.exit(main())
