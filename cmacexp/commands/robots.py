"""``python -m cmacexp.robots go1``: parameters of a robot model, and the settings that are derived from it."""

import json
import math
import shlex
from pathlib import Path

import numpy as np

from cmacexp.commands.command import OVERRIDES, Arguments, command
from cmacexp.config import Config, config_folder, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.config.describe import describe_fields, flatten_config
from cmacexp.config.machine import LEG_NAMES, RobotMachine, read_model
from cmacexp.errors import BadInput, require, suggest
from cmacexp.loop.margin import JOINT_NAMES, find_sampled_limit, judge_walk
from cmacexp.metrics.registry import format_number
from cmacexp.models.robot import Robot
from cmacexp.models.robot_gains import DriveGains, derive_basis, find_joint_margin
from cmacexp.planning.machine import make_mechanism
from cmacexp.planning.plan import make_plan
from cmacexp.terminal.messages import print_table, warn_of_models
from cmacexp.terminal.output import print_line

SETTINGS = (
    "sampling_period",
    "controller.position_gain",
    "controller.velocity_gain",
    "controller.lead_omega",
    "controller.lead_alpha",
    "controller.stiffness",
    "controller.damping",
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
"""Config fields that are derived from the model, and the fields to compare them with."""

BY_RULE = (("hybrid", ""), ("hybrid", "0.002"), ("hybrid", "0.001"), ("drives", ""))
"""Controller and sampling period, s, for each of which the delay margin is printed; empty: the derived period."""
MARGIN_GROUPS = ("scenario", "machine", "gait", "sensors", "actuator")
"""Other config groups on which the delay margin depends."""


def _choose(robot: str) -> list[str]:
    """Return the overrides that select a robot, given the name of its option or its file; raises BadInput."""
    names = [path.stem for path in (config_folder() / "machine").glob("*.yaml")]
    if robot in names:
        return [f"machine={robot}"]
    require(
        Path(robot).is_file(),
        "machine",
        robot,
        f"must be an option of conf/machine, or an MJCF or URDF file{suggest(robot, names)}",
    )
    return ["machine=mjcf", f"machine.path={quote_value(str(Path(robot).resolve()))}"]


def quote_value(value: object) -> str:
    """Format a value for an override, as JSON, in which Hydra can read any text and list."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def list_legs(robot: Robot, machine: RobotMachine) -> list[list[str]]:
    """List rows of a table: each leg, its joints, its foot, and its angles at home, rad."""
    return [
        [leg, ", ".join(map(str, joints)), str(foot), ", ".join(f"{angle:g}" for angle in home)]
        for leg, joints, foot, home in zip(LEG_NAMES, machine.joints, machine.feet, robot.home.tolist(), strict=True)
    ]


def list_joints(robot: Robot) -> list[list[str]]:
    """List rows of a table: name, unit, and values of hip, thigh and calf joint, from the model."""
    quantities = [
        ("largest torque", "N m", robot.torque_limits),
        ("dry friction", "N m", robot.friction),
        ("damping", "N m s/rad", robot.damping),
        ("inertia of the rotor", "kg m^2", robot.armature),
        ("least angle, all legs", "rad", robot.ranges[..., 0].max(axis=0)),
        ("largest angle, all legs", "rad", robot.ranges[..., 1].min(axis=0)),
    ]
    return [[name, unit, *map(format_number, values.tolist())] for name, unit, values in quantities]


def _plan_walk(config: Config) -> tuple[list[list[str]], list[str]]:
    """Plan the walk, and compare its stability margin and its torques with what the robot has.

    Returns rows of the table of joints, largest planned torque and what it is of the limit, and lines about the
    stance, with warnings, which a run prints too.
    """
    try:
        mechanism = make_mechanism(config.machine)
        plan = make_plan(config.nominal, mechanism, feedforward_acts=False)
    except BadInput as error:
        return [], [f"this walk is refused: {error}"]
    walk = judge_walk(config, mechanism, plan)
    rows = [
        ["largest planned torque", "N m", *map(format_number, walk.torque.tolist())],
        ["over the largest torque", "", *map(format_number, walk.share.tolist())],
    ]
    front, rear = walk.widths
    lines = [f"feet stand {front:.3g} m apart in front and {rear:.3g} m in the rear"]
    if not np.isnan(walk.margin):  # of a gait that always has three feet down
        lines.append(f"least stability margin of the planned gait: {1e3 * walk.margin:.3g} mm")
    if not np.isnan(walk.roll_stiffness):
        lines.append(
            f"roll stiffness on four feet over that with which the body tips over: {walk.roll_stiffness:.3g}"
        )
    return rows, [*lines, *(f"warning: {text}" for text in walk.list_warnings())]


def list_settings(config: Config) -> list[list[str]]:
    """List rows of a table: key, unit and value of the config fields in :data:`SETTINGS`."""
    plain = to_plain(config)
    values = flatten_config(plain)
    described = describe_fields(plain)
    return [[key, described[key].unit, format_number(values[key])] for key in SETTINGS if key in values]


def _describe_margin(config: Config) -> list[str]:
    """Compute a row of a table: controller, period, crossover and delay margin; empty for a custom controller."""
    from cmacexp.control import DriveController, HybridController
    from cmacexp.loop.margin import SMALL_MARGIN, find_margin
    from cmacexp.loop.scenario import count_loop_delay, make_component

    controller, sensors = (make_component(group, vars(config)[group]) for group in ("controller", "sensors"))
    if isinstance(controller, DriveController):
        drives = DriveGains(controller.config.stiffness, controller.config.damping)
        name = "drives"
        margin = find_joint_margin(read_model(config.machine), drives, config.actuator.lag)
        note = "in drives, not on a bus"
    elif isinstance(controller, HybridController):
        name = "hybrid"
        margin = find_margin(config, controller.config, count_loop_delay(config, sensors))
        note = "small" if margin.delay < SMALL_MARGIN else ""
    else:
        return []
    numbers = (config.sampling_period, margin.crossover / (2.0 * math.pi), 1e3 * margin.delay)
    return [name, *map(format_number, numbers), note]


def _list_margins(config: Config, overrides: list[str]) -> list[list[str]]:
    """List rows of a table: delay margin of a config, and of each controller and period in :data:`BY_RULE`."""
    rows = {} if not (row := _describe_margin(config)) else {tuple(row[:2]): row}
    relevant = [text for text in overrides if text.startswith(MARGIN_GROUPS)]
    for controller, period in BY_RULE:
        setting = [f"controller={controller}", *([f"sampling_period={period}"] if period else [])]
        try:
            row = _describe_margin(compose_config([*relevant, *setting]))
        except BadInput:  # a run with this setting prints the reason
            row = [controller, period or "by rule", "", "", "refused"]
        rows.setdefault(tuple(row[:2]), row)
    return [*rows.values()]


@command(
    "robots",
    "Print the parameters of a robot model, the delay margin, and the settings that are derived from the model.",
    {
        "robot": {
            "metavar": "ROBOT",
            "help": "name of an option of conf/machine, such as go1, or an MJCF or URDF file",
        },
        **OVERRIDES,
    },
)
def main(arguments: Arguments) -> None:
    """Print a robot model, its delay margins and the derived settings."""
    selection = _choose(arguments.robot)
    overrides = ["scenario=robot", *selection, *arguments.overrides]
    config = compose_config(overrides)
    assert isinstance(config.machine, RobotMachine)
    robot = read_model(config.machine)
    if len(selection) > 1:
        print_line(f"python -m cmacexp {shlex.join(overrides)}")
        print_table(["leg", "joints", "foot", "home, rad"], list_legs(robot, config.machine))
    basis = derive_basis(robot)
    print_line(str(robot.path))
    print(f"mass {format_number(basis.mass, 'kg')}, links {robot.links[0]:.3g} m and {robot.links[1]:.3g} m")
    print(f"fingerprint {robot.fingerprint}")
    warn_of_models([config.machine])
    print(f"effective mass at a foot at least {format_number(basis.foot_mass, 'kg')}, {basis.ratio:.3g} of the mass")
    margins = _list_margins(config, overrides)
    print_table(["controller", "period, s", "crossover, Hz", "delay margin, ms", ""], margins)
    limit = format_number(find_sampled_limit(config), "N m s/rad")
    print_line(f"damping from which drives that compute once a command shake: {limit}")
    torques, lines = _plan_walk(config)
    print_table(["", "unit", *JOINT_NAMES], [*list_joints(robot), *torques])
    for line in lines:
        print_line(line)
    print_table(["", "unit", "value"], list_settings(config))
