"""``python -m cmacexp.robots go1``: what the model of a robot holds, and what follows from it by rule."""

import json
import math
import shlex
from pathlib import Path

from omegaconf import OmegaConf

from cmacexp.commands.command import OVERRIDES, Arguments, command
from cmacexp.config import Config, config_folder, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.config.describe import describe_fields, flatten_config
from cmacexp.config.machine import LEG_NAMES, read_model
from cmacexp.errors import BadInput, require, suggest
from cmacexp.metrics.registry import format_number
from cmacexp.models.robot import Robot, read_robot
from cmacexp.models.robot_gains import DriveGains, derive_basis, find_joint_margin
from cmacexp.models.robot_search import find_names
from cmacexp.planning.machine import find_stance
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
"""Fields of the config that follow from the model, and those beside which they are read."""

BY_RULE = (("hybrid", ""), ("hybrid", "0.002"), ("hybrid", "0.001"), ("drives", ""))
"""Controllers and sampling periods, s, or those by rule, that the margin of a robot is shown for."""
COUNTED = ("scenario", "machine", "gait", "sensors", "actuator")
"""Groups on which it depends besides."""


def _choose(robot: str) -> list[str]:
    """Overrides that choose a robot by the name of its option, or by its file."""
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
    """A value as an override has it: JSON, as which Hydra reads texts and lists."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def _find_legs(path: Path) -> list[str]:
    """Overrides that a model needs to which the names and the home of ``machine=mjcf`` do not fit; shows them."""
    default = OmegaConf.load(config_folder() / "machine" / "mjcf.yaml")
    try:
        robot = read_robot(path, default.joints, default.feet, list(default.home))
        find_stance(robot, derive_basis(robot).hip_height)
        return []
    except BadInput as error:
        if error.key not in ("machine.joints", "machine.feet", "machine.home"):
            raise
    joints, feet, home = names = find_names(path)
    homes = home if isinstance(home[0], list) else [home] * len(feet)
    rows = [[leg, ", ".join(j), f, str(h)] for leg, j, f, h in zip(LEG_NAMES, joints, feet, homes, strict=True)]
    print_table(["leg", "joints", "foot", "home, rad"], rows)
    return [f"machine.{key}={quote_value(value)}" for key, value in names._asdict().items()]


def list_joints(robot: Robot) -> list[list[str]]:
    """Rows of a table: what the model says of hip, thigh and calf, each with its unit."""
    quantities = [
        ("largest torque", "N m", robot.torque_limits),
        ("dry friction", "N m", robot.friction),
        ("damping", "N m s/rad", robot.damping),
        ("inertia of the rotor", "kg m^2", robot.armature),
        ("least angle, all legs", "rad", robot.ranges[..., 0].max(axis=0)),
        ("largest angle, all legs", "rad", robot.ranges[..., 1].min(axis=0)),
    ]
    return [[name, unit, *map(format_number, values.tolist())] for name, unit, values in quantities]


def list_settings(config: Config) -> list[list[str]]:
    """Rows of a table: fields of the config, each with its unit."""
    plain = to_plain(config)
    values, described = flatten_config(plain), describe_fields(plain)
    return [[key, described[key].unit, format_number(values[key])] for key in SETTINGS if key in values]


def _describe_margin(config: Config) -> list[str]:
    """A row of a table: the further delay that feedback bears; empty with a controller of the user's own."""
    from cmacexp.control import DriveController, HybridController
    from cmacexp.loop.margin import SMALL_MARGIN, find_margin
    from cmacexp.loop.scenario import count_loop_delay, make_component

    controller, sensors = (make_component(group, vars(config)[group]) for group in ("controller", "sensors"))
    if isinstance(controller, DriveController):
        drives = DriveGains(controller.config.stiffness, controller.config.damping)
        name, margin = "drives", find_joint_margin(read_model(config.machine), drives, config.actuator.lag)
        note = "in drives, not on a bus"
    elif isinstance(controller, HybridController):
        name, margin = "hybrid", find_margin(config, controller.config, count_loop_delay(config, sensors))
        note = "small" if margin.delay < SMALL_MARGIN else ""
    else:
        return []
    numbers = (config.sampling_period, margin.crossover / (2.0 * math.pi), 1e3 * margin.delay)
    return [name, *map(format_number, numbers), note]


def _list_margins(config: Config, overrides: list[str]) -> list[list[str]]:
    """Rows of a table: the margin of a config, and those by rule of each controller and rate."""
    rows = {} if not (row := _describe_margin(config)) else {tuple(row[:2]): row}
    counted = [text for text in overrides if text.startswith(COUNTED)]
    for controller, period in BY_RULE:
        setting = [f"controller={controller}", *([f"sampling_period={period}"] if period else [])]
        try:
            row = _describe_margin(compose_config([*counted, *setting]))
        except BadInput:  # a run with this setting says why
            row = [controller, period or "by rule", "", "", "refused"]
        rows.setdefault(tuple(row[:2]), row)
    return [*rows.values()]


@command(
    "robots",
    "Show what the model of a robot holds, and the settings that follow from it by rule.",
    {
        "robot": {"metavar": "ROBOT", "help": "go1 or another option of conf/machine, or an MJCF or URDF file"},
        **OVERRIDES,
    },
)
def main(arguments: Arguments) -> None:
    """Print the robot."""
    chosen = _choose(arguments.robot)
    if len(chosen) > 1 and not any(word.startswith("machine.") for word in arguments.overrides):
        chosen += (found := _find_legs(Path(arguments.robot).resolve()))
        if found:
            print(f"python -m cmacexp {shlex.join(['scenario=robot', *chosen, *arguments.overrides])}")
    config = compose_config(["scenario=robot", *chosen, *arguments.overrides])
    robot = read_model(config.machine)
    basis = derive_basis(robot)
    length_1, length_2 = robot.links
    print_line(str(robot.path))
    print(f"mass {format_number(basis.mass, 'kg')}, links {length_1:.3g} m and {length_2:.3g} m")
    print(f"fingerprint {robot.fingerprint}")
    warn_of_models([config.machine])
    print(f"a foot feels {format_number(basis.foot_mass, 'kg')} at least, {basis.ratio:.3g} of the mass")
    margins = _list_margins(config, ["scenario=robot", *chosen, *arguments.overrides])
    print_table(["controller", "period, s", "crossover, Hz", "more delay, ms", ""], margins)
    print_table(["", "unit", "hip", "thigh", "calf"], list_joints(robot))
    print_table(["", "unit", "value"], list_settings(config))
