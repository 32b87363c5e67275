"""Geometry and masses of the machines."""

from dataclasses import dataclass, field, fields

from cmacexp.config.fields import choice, number
from cmacexp.errors import BadInput
from cmacexp.models.robot import Robot, read_robot
from cmacexp.models.robot_file import describe_origin, find_model

HAS_BODY = ("machine.kind in ('quadruped', 'robot')",)
"""What fields that concern a body, or choose among legs, need to have an effect."""


@dataclass
class LinksConfig:
    """Two links with point masses at knee and foot (Lin & Song 1997, eq. 23)."""

    length_1: float = number("m", above=0)
    """Hip to knee, l1."""
    length_2: float = number("m", above=0)
    """Knee to foot, l2."""
    mass_1: float = number("kg", above=0)
    """Mass at the knee, m1."""
    mass_2: float = number("kg", above=0)
    """Mass at the foot, m2."""


@dataclass
class LegConfig(LinksConfig):
    """A planar two-link leg."""

    knee: str = choice("back", "forward")
    """Side to which the knee bends: back is theta2 < 0 (assumed)."""


@dataclass
class LegMachine:
    """One leg on a stand."""

    leg: LegConfig
    kind: str = choice("leg")
    """What the machine is; decides its other fields."""
    hip_height: float = number("m", above=0)
    """Height of the hip above the undepressed ground."""


@dataclass
class BodyLegConfig(LegConfig):
    """A leg under a body."""

    hip_x: float = number("m")
    """Hip in the body frame, forward of the centre of gravity."""
    hip_y: float = number("m")
    """Hip in the body frame, to the left."""


@dataclass
class FourLegs:
    """The legs of a quadruped, in the order of their numbers."""

    left_front: BodyLegConfig
    right_front: BodyLegConfig
    left_rear: BodyLegConfig
    right_rear: BodyLegConfig

    @property
    def in_order(self) -> list[BodyLegConfig]:
        """Legs 1 to 4."""
        return [vars(self)[key] for key in LEG_KEYS]


LEG_KEYS = tuple(field.name for field in fields(FourLegs))
"""Keys of legs 1 to 4 under a body."""
LEG_NAMES = tuple(key.replace("_", " ") for key in LEG_KEYS)
"""Names of legs 1 to 4 in words."""


MASS_COUNTS = ("option.plant == 'mujoco_quadruped' or force_control.load_sharing != 'static' or own.weight is None",)
"""What the mass of a body needs, which weighs as much as ``weight`` says wherever it does not move."""


@dataclass
class QuadrupedMachine:
    """Four legs under a body whose height, pitch and roll balance weight and moments (Lin & Song 1997, section 6)."""

    leg: LinksConfig
    """Links of all legs, unless ``legs`` sets those of one leg."""
    legs: FourLegs
    kind: str = choice("quadruped")
    """What the machine is; decides its other fields."""
    hip_height: float = number("m", above=0.25)
    """Height of the hips above the undepressed ground that the feet are planned for, h0 (assumed)."""
    body_mass: float = number("kg", above=0, needs=MASS_COUNTS)
    """Mass of the body without its legs, for plants and plans in which it moves; 1 kg in the paper."""
    weight: float | None = number("N", above=0)
    """Load of all feet where leg masses do not load the body; 40 N in the paper; null: weight of all masses."""

    @property
    def hips(self) -> list[tuple[float, float]]:
        """Hips 1 to 4 in the body frame, forward and left, m."""
        return [(leg.hip_x, leg.hip_y) for leg in self.legs.in_order]


@dataclass
class PointMassMachine:
    """The leg as a point mass that moves along x and y (Lin & Song 1997, eq. 2-4)."""

    kind: str = choice("point_mass")
    """What the machine is; decides its other fields."""
    hip_height: float = number("m", above=0)
    """Depth of the undepressed ground below the origin."""
    mass: float = number("kg", above=0)
    """Mass of the point."""
    start_clearance: float = number("m")
    """Height of the mass above the undepressed ground at the start (assumed)."""


@dataclass
class RobotModel:
    """Which model of a quadruped with three joints a leg; legs front left, front right, rear left, rear right."""

    model: str | None = field(kw_only=True)
    """Name under which an installed package or a checkout has the model; null: ``path`` says which."""
    path: str | None = field(kw_only=True)
    """MJCF or URDF file of the model; null: it is looked up by its name, never downloaded."""
    joints: list[list[str]] = field(kw_only=True)
    """Joints of each leg in the model: hip, thigh, calf."""
    feet: list[str] = field(kw_only=True)
    """Geoms, sites or bodies of the feet in the model."""
    home: list[float | list[float]] = number("rad", at_least=-10, at_most=10)
    """Joint angles of every leg, or of each, at which the rule for the gains looks; knees bend to this side."""
    measured_with: str | None = field(default=None, kw_only=True)
    """Package, with its version, whose model the results of this project were measured with; null: there are none."""
    fingerprint: str | None = field(default=None, kw_only=True)
    """Fingerprint of that model, see :attr:`cmacexp.models.robot.Robot.fingerprint`."""


def ask_for_robot(machine: RobotModel) -> BadInput:
    """The mistake of a robot in a scenario, or under a plant, that is for other machines."""
    name = machine.model or "mjcf"
    needs = "a robot needs a gait of four legs and plant=mujoco_robot"
    return BadInput("machine", name, f"{needs}: use scenario=robot machine={name}")


def read_model(machine: RobotModel) -> Robot:
    """The robot that a config names; raises BadInput if there is no such model, or it is no quadruped."""
    return read_robot(find_model(machine.model, machine.path), machine.joints, machine.feet, machine.home)


def describe_other_model(machine: object) -> str:
    """Say in one line that the model of a robot is not the one that results were measured with; empty if it is.

    It is also empty where nothing is known of such results: for other machines, and for a model of the user's own.
    """
    if (
        not isinstance(machine, RobotModel)
        or None in (machine.model, machine.fingerprint)
        or machine.path is not None
    ):
        return ""
    if (robot := read_model(machine)).fingerprint == machine.fingerprint:
        return ""
    installed = describe_origin(robot.path)
    other = f"the installed model, of {installed}, is not the one that results were measured with"
    return f"machine={machine.model}: {other}, of {machine.measured_with}: results are not comparable"


@dataclass
class RobotMachine(RobotModel):
    """A robot as its model describes it: masses, geometry, limits and losses are those of the model."""

    kind: str = choice("robot")
    """What the machine is; decides its other fields."""
    hip_height: float = number("m", above=0)
    """Height of the thigh joints above the undepressed ground that the feet are planned for, h0."""
    latency: float = number("s", at_least=0, at_most=0.1, default=0.0)
    """Delay of bus, sensors and drives together that gains, period and lead count, and that nothing simulates."""

    @property
    def hips(self) -> list[tuple[float, float]]:
        """Thigh joints 1 to 4 in the frame of the trunk, forward and left, m."""
        return [(float(x), float(y)) for x, y in read_model(self).hinges[:, 1, :2]]


BodyMachine = QuadrupedMachine | RobotMachine
"""Machines with a body."""
MACHINES = {"leg": LegMachine, "point_mass": PointMassMachine, "quadruped": QuadrupedMachine, "robot": RobotMachine}
