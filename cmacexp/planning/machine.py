"""The machine that a config describes."""

from cmacexp.config import Config
from cmacexp.config.check import TOLERANCE
from cmacexp.config.machine import LegConfig, LegMachine, PointMassMachine, QuadrupedMachine, RobotMachine
from cmacexp.errors import BadInput
from cmacexp.models.leg import GRAVITY, Leg
from cmacexp.models.mechanism import Mechanism, legs_on_stand, legs_under_body, point_mass
from cmacexp.planning.robot import make_robot_mechanism


def compute_weight_of_masses(machine: QuadrupedMachine) -> float:
    """Weight of the body and all its legs, N."""
    legs = 0.0
    for leg in machine.legs.in_order:  # sum() rounds differently from Python 3.12 on
        legs += leg.mass_1 + leg.mass_2
    return GRAVITY * (machine.body_mass + legs)


def make_leg(config: LegConfig) -> Leg:
    """The leg that a config describes."""
    knee = -1.0 if config.knee == "back" else 1.0
    return Leg(config.length_1, config.length_2, config.mass_1, config.mass_2, knee)


def make_mechanism(machine: LegMachine | PointMassMachine | QuadrupedMachine | RobotMachine) -> Mechanism:
    """The machine that a config describes."""
    if isinstance(machine, RobotMachine):
        return make_robot_mechanism(machine)
    if isinstance(machine, PointMassMachine):
        return point_mass(machine.mass, machine.hip_height)
    if isinstance(machine, QuadrupedMachine):
        legs = [make_leg(leg) for leg in machine.legs.in_order]
        weight = compute_weight_of_masses(machine) if machine.weight is None else machine.weight
        return legs_under_body(legs, machine.hip_height, machine.hips, weight)
    return legs_on_stand([make_leg(machine.leg)], machine.hip_height)


def check_load_sharing(config: Config) -> None:
    """Check that dynamic load sharing has a body whose weight is that of its masses; raises BadInput."""
    machine = config.machine
    if config.force_control.load_sharing == "static" or isinstance(machine, RobotMachine):
        return
    if not isinstance(machine, QuadrupedMachine):
        allowed = f"must be static with machine.kind={machine.kind}, whose force is force_control.desired_force"
        raise BadInput("force_control.load_sharing", config.force_control.load_sharing, allowed)
    of_masses = compute_weight_of_masses(machine)
    if machine.weight is not None and abs(machine.weight - of_masses) > TOLERANCE * of_masses:
        raise BadInput(
            "machine.weight",
            machine.weight,
            f"must be null or {of_masses:.6g} N, the weight of all masses, with force_control.load_sharing=dynamic",
        )
