"""Machines: geometry and masses of legs and bodies, and the models of robots."""

from dataclasses import dataclass, field, fields
from typing import Any

from cmacexp.config.fields import choice, number
from cmacexp.errors import BadInput, require
from cmacexp.models.leg import GRAVITY_TERMS
from cmacexp.models.robot import Robot, read_robot
from cmacexp.models.robot_file import describe_origin, find_model
from cmacexp.models.robot_gains import HEAVY_FOOT, PERIODS, compute_foot_mass, limit_period

HAS_BODY = ("machine.kind in ('quadruped', 'robot')",)
"""Condition for an effect of fields of the body and of fields that select legs."""


@dataclass
class LinksConfig:
    """Two links with point masses at knee and foot (Lin & Song 1997, eq. 23)."""

    length_1: float = number("m", above=0)
    """Length from hip to knee, l1."""
    length_2: float = number("m", above=0)
    """Length from knee to foot, l2."""
    mass_1: float = number("kg", above=0)
    """Mass at the knee, m1."""
    mass_2: float = number("kg", above=0)
    """Mass at the foot, m2."""


def gravity_factors() -> Any:
    """Declare the factors of the terms of G in eq. 23 that a plant or a model uses."""
    needs = ("machine.kind in ('leg', 'quadruped')",)
    return number("", at_least=-10, at_most=10, needs=needs, default=[1.0] * GRAVITY_TERMS)


def check_gravity_factors(group: str, factors: list[float]) -> None:
    """Require one factor for each term of the gravity vector; raise BadInput otherwise."""
    allowed = f"must be {GRAVITY_TERMS} numbers, one for each term of G in eq. 23; [1,1,1,1] is G as printed"
    require(len(factors) == GRAVITY_TERMS, f"{group}.gravity_factors", factors, allowed)


@dataclass
class LegConfig(LinksConfig):
    """A planar two-link leg."""

    knee: str = choice("back", "forward")
    """Direction in which the knee bends; back: theta2 < 0 (assumed)."""


@dataclass
class LegMachine:
    """One leg on a stand."""

    leg: LegConfig
    kind: str = choice("leg")
    """Kind of machine; determines its other fields."""
    hip_height: float = number("m", above=0)
    """Height of the hip above the undepressed ground."""


@dataclass
class BodyLegConfig(LegConfig):
    """A leg under a body."""

    hip_x: float = number("m")
    """Position of the hip in the body frame, forward of the centre of gravity."""
    hip_y: float = number("m")
    """Position of the hip in the body frame, to the left."""


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
"""Condition for an effect of the body mass: elsewhere the body does not accelerate, and ``weight`` is its load."""


@dataclass
class QuadrupedMachine:
    """Four legs under a body, whose height, pitch and roll follow from equilibrium (Lin & Song 1997, section 6)."""

    leg: LinksConfig
    """Links of all legs; ``legs`` overrides them for individual legs."""
    legs: FourLegs
    kind: str = choice("quadruped")
    """Kind of machine; determines its other fields."""
    hip_height: float = number("m", above=0.25)
    """Planned height of the hips above the undepressed ground, h0 (assumed)."""
    body_mass: float = number("kg", above=0, needs=MASS_COUNTS)
    """Mass of the body without its legs, for plants and plans with an accelerating body; 1 kg in the paper."""
    weight: float | None = number("N", above=0)
    """Total load of the feet if the plant ignores the weight of the legs; 40 N in the paper; null: weight of all
    masses."""

    @property
    def hips(self) -> list[tuple[float, float]]:
        """Position of hips 1 to 4 in the body frame, (forward, left), m."""
        return [(leg.hip_x, leg.hip_y) for leg in self.legs.in_order]


@dataclass
class PointMassMachine:
    """The leg as a point mass that moves along x and y (Lin & Song 1997, eq. 2-4)."""

    kind: str = choice("point_mass")
    """Kind of machine; determines its other fields."""
    hip_height: float = number("m", above=0)
    """Height of the origin above the undepressed ground."""
    mass: float = number("kg", above=0)
    """Mass of the leg."""
    start_clearance: float = number("m")
    """Height of the mass above the undepressed ground at the start (assumed)."""


@dataclass(kw_only=True)
class RobotModel:
    """Model of a quadruped with three joints per leg; legs: front left, front right, rear left, rear right."""

    model: str | None
    """Name of the model in an installed package or a checkout; null: the model is the file ``path``."""
    path: str | None
    """MJCF or URDF file of the model; null: the model is found by its name, never downloaded."""
    joints: list[list[str | int]]
    """Names of the hip, thigh and calf joint of each leg in the model."""
    feet: list[str | int]
    """Names of the geoms, sites or bodies of the feet in the model."""
    home: list[float | list[float]] = number("rad", at_least=-10, at_most=10)
    """Hip, thigh and calf angle at which gains are derived, for all legs or per leg; sets the side knees bend to, and
    by the hip angle how far to the side the feet stand."""
    weld: list[str] = field(default_factory=list)
    """Names of joints of the model that are held at zero, such as wheels and those of a camera."""
    yaw: float = number("rad", at_least=-4, at_most=4, default=0.0)
    """Angle from the x axis of the trunk in the model to forward, about z."""
    rotor_inertia: float = number("kg m^2", at_least=0, at_most=1e3, default=0.0)
    """Inertia of the rotors of leg joints for which the model has none."""
    measured_with: str | None = None
    """Package and version of the model in the published results of this project; null: there are no such results."""
    fingerprint: str | None = None
    """Fingerprint of the model in the published results, see :attr:`cmacexp.models.robot.Robot.fingerprint`."""


def ask_for_robot(model: str | None) -> BadInput:
    """Make the input error for a robot, ``machine.model``, in a scenario, or with a plant, for other machines."""
    name = model or "mjcf"
    needs = "a robot needs a gait of four legs and plant=mujoco_robot"
    return BadInput("machine", name, f"{needs}: use scenario=robot machine={name}")


def read_model(machine: RobotModel) -> Robot:
    """Read the model of a robot; raises BadInput if it is not found or not a supported quadruped."""
    path = find_model(machine.model, machine.path)
    names = machine.joints, machine.feet, machine.home
    return read_robot(path, *names, machine.weld, machine.yaw, machine.rotor_inertia)


def _list_heavy_feet(robot: Robot) -> list[str]:
    """Return a warning, as a list, of a long sampling period with feet as heavy as wheels; empty for others."""
    ratio = compute_foot_mass(robot) / robot.mass
    if ratio <= HEAVY_FOOT or limit_period(robot) <= PERIODS[0][0]:
        return []
    return [
        f"a foot feels {ratio:.2g} of the mass of the robot, as with wheels: "
        f"with a sampling_period above {PERIODS[0][0]:g} it may fall or learn little"
    ]


def describe_other_model(machine: object) -> str:
    """Return a one-line warning if the model of a robot differs from the one used for the published results.

    For a model file of the user it says in what the robot differs from the file. Empty if there is no difference,
    where no results are published, and for other machines.
    """
    if not isinstance(machine, RobotModel):
        return ""
    if machine.path is not None:
        robot = read_model(machine)
        notes = (*robot.notes, *_list_heavy_feet(robot))
        return f"machine.path={machine.path}: {'; '.join(notes)}" if notes else ""
    if None in (machine.model, machine.fingerprint):
        return ""
    if (robot := read_model(machine)).fingerprint == machine.fingerprint:
        return ""
    return (
        f"machine={machine.model}: the installed model, of {describe_origin(robot.path)}, is not the one that "
        f"results were measured with, of {machine.measured_with}: results are not comparable"
    )


@dataclass
class RobotMachine(RobotModel):
    """Robot with the masses, geometry, limits and losses of its model."""

    kind: str = choice("robot")
    """Kind of machine; determines its other fields."""
    hip_height: float = number("m", above=0)
    """Planned height of the thigh joints above the undepressed ground, h0."""
    width: float | None = number("m", default=None)
    """Width of the stance, that of ``gait.width``."""
    latency: float = number("s", at_least=0, at_most=0.1, default=0.0)
    """Total delay of bus, sensors and drives of a real robot: used for gains, period and lead, not simulated."""

    @property
    def hips(self) -> list[tuple[float, float]]:
        """Position of thigh joints 1 to 4 in the frame of the trunk, (forward, left), m."""
        return [(float(x), float(y)) for x, y in read_model(self).hinges[:, 1, :2]]


BodyMachine = QuadrupedMachine | RobotMachine
"""Machines with a body."""
MACHINES = {"leg": LegMachine, "point_mass": PointMassMachine, "quadruped": QuadrupedMachine, "robot": RobotMachine}
