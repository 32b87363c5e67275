"""Check a config before anything is planned or simulated."""

from cmacexp.config.check_environment import check_payload, check_slope, check_stiffness_step
from cmacexp.config.check_gait import check_legs, check_pattern, check_timing
from cmacexp.config.cmac import check_cmac
from cmacexp.config.component import COMPONENTS, ComponentConfig
from cmacexp.config.fields import check_fields
from cmacexp.config.machine import RobotMachine, ask_for_robot, read_model
from cmacexp.config.memory import check_memory
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

MOST_ROWS = 2**24
"""Steps times legs of the longest cycle, which is held in memory as a whole."""
MOST_STEPS = 2**31 - 1
"""Steps of the longest run: the trace counts them in 32 bits."""


def check_robot(config: Config) -> None:
    """Check that a robot has four legs, and a model that can be found: a quadruped with three hinges a leg."""
    if isinstance(config.machine, RobotMachine):
        if config.legs == 1 and config.scenario != "robot":
            raise ask_for_robot(config.machine)
        read_model(config.machine)


def check_gains(config: Config) -> None:
    """Require a velocity gain above 0, of whatever controller, where the reference divides by it."""
    if config.force_control.method == "damping" and config.gains is not None and config.gains[1] == 0.0:
        raise BadInput("controller.velocity_gain", 0.0, "must be above 0 with force_control=damping (eq. 11)")


def check_length(config: Config) -> None:
    """Check that a cycle fits into memory, and that the trace can count the steps of the run."""
    steps = config.steps_per_cycle
    if steps * config.legs > MOST_ROWS:
        raise BadInput(
            "sampling_period",
            config.sampling_period,
            f"gives {steps} steps a cycle, more than the {MOST_ROWS // config.legs} that a cycle can have",
        )
    if config.cycles > MOST_STEPS // steps:
        raise BadInput("cycles", config.cycles, f"must be at most {MOST_STEPS // steps} with {steps} steps a cycle")


def check_actuator(config: Config) -> None:
    """Check that the delay of the torques is shorter than a cycle."""
    longest = config.steps_per_cycle - 1
    if config.actuator.delay > longest:
        raise BadInput("actuator.delay", config.actuator.delay, f"must be at most {longest}, less than a cycle")


def check_record(config: Config) -> None:
    """Check that the cycles to be recorded are cycles of the run."""
    for cycle in config.record.cycles or []:
        if cycle > config.cycles:
            raise BadInput("record.cycles", cycle, f"must be at most {config.cycles}, the cycles of the run")


def check(config: Config) -> None:
    """Check every field, and every combination that can be judged before planning.

    Raises:
        BadInput: names the key, the value, what is allowed and how to mend it.
    """
    check_fields(config)
    check_robot(config)
    check_timing(config)
    check_legs(config)
    check_stiffness_step(config)
    check_slope(config)
    check_payload(config)
    check_pattern(config)
    check_length(config)
    check_record(config)
    check_gains(config)
    check_cmac(config.cmac, config.joints)
    check_actuator(config)
    for group in COMPONENTS:
        component = getattr(config, group)
        if isinstance(component, ComponentConfig):
            component.check(config)
    check_memory(config)
