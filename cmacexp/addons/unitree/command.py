"""``cmacexp robot``: plays a robot on this computer, for plant=unitree."""

from functools import partial
from typing import Any

from omegaconf import OmegaConf

from cmacexp.addons.unitree.hung import draw_chirp, learn_strokes, make_memory
from cmacexp.addons.unitree.network import LOOPBACK
from cmacexp.addons.unitree.simulated import KINDS, NO_FAULT, Fault, SimulatedRobot, play
from cmacexp.commands.command import OVERRIDES, Arguments, command, make_flag
from cmacexp.commands.robots import quote_value
from cmacexp.config import config_folder
from cmacexp.config.compose import compose_config
from cmacexp.config.machine import LEG_NAMES
from cmacexp.errors import CmacexpError
from cmacexp.metrics.registry import format_number
from cmacexp.terminal.messages import print_table
from cmacexp.terminal.output import print_line, show_activity
from cmacexp.typing import Array, Status

PLAYED = [
    "scenario=robot", "machine=go2", "plant=mujoco_robot_rigid", "plant/as_built=go2", "actuator=go2",
    "controller=drives", "feedforward=none", "sensors=proprioceptive",
]  # fmt: skip
"""The robot that is played where nothing else is asked for."""

HUNG = ["scenario=robot", "machine=go2", "plant=unitree", "controller=drives"]
"""The robot that hangs likewise."""

LONGEST = 3600.0
"""Time for which a robot is played if commands do not cease, s."""

FAULTS = "; ".join(f"{name}: {meaning}" for name, meaning in KINDS.items())


def _move_hung(arguments: Arguments) -> None:
    from cmacexp.loop.scenario import make_scenario

    log = [f"plant.log={quote_value(arguments.chirp)}"] if arguments.chirp else []
    scenario = make_scenario(compose_config([*HUNG, *log, f"plant.domain={arguments.domain}", *arguments.overrides]))
    if scenario.fault is not None:
        raise scenario.fault
    plant: Any = scenario.plant  # plant=unitree
    status = Status.FAILED
    try:
        with show_activity("the joints are checked, then move"):
            if arguments.chirp:
                plant.move_hung(draw_chirp)
            else:
                leg, setup = LEG_NAMES.index(arguments.learn), scenario.setup
                learn = partial(learn_strokes, leg=leg, memory=make_memory(), lead=setup.lead, rate=setup.rate)
                strokes: Array = plant.move_hung(learn)
        status = Status.COMPLETED
    finally:
        plant.end_run(is_safe=status == Status.COMPLETED)
    if arguments.chirp:
        print_line(f"{arguments.chirp}: python -m cmacexp.gap {arguments.chirp} --robot go2")
    else:
        rows = [[str(k), *map(format_number, row * [1e3, 1.0])] for k, row in enumerate(strokes, start=1)]
        print_table(["stroke", "joint error, mrad", "feedback, N m"], rows)


def _play(arguments: Arguments) -> None:
    config = compose_config([*PLAYED, *arguments.overrides])
    fault = Fault(arguments.fault, round(arguments.after / config.sampling_period), arguments.motor)
    crouch = OmegaConf.load(config_folder() / "plant" / "unitree.yaml").crouch
    robot = SimulatedRobot(config, not arguments.lying, list(crouch))
    print_line(play(robot, LOOPBACK, arguments.domain, LONGEST, fault, arguments.patient))


@command(
    "robot",
    f"Play a robot on this computer's loopback for plant=unitree. Faults: {FAULTS}.",
    {
        "--simulate": make_flag("play a robot; it ends once commands cease"),
        "--chirp": {"metavar": "LOG", "help": "move the joints of a robot that hangs, for cmacexp gap LOG"},
        "--learn": {"metavar": "LEG", "choices": LEG_NAMES, "help": "let a leg of a robot that hangs learn"},
        "--domain": {"type": int, "default": 0, "metavar": "N", "help": "of DDS, as plant.domain (0)"},
        "--lying": make_flag("it lies on the ground and does not hang at first"),
        "--patient": make_flag("wait for each command: not in real time"),
        "--fault": {"default": NO_FAULT, "metavar": "KIND", "help": "a fault that it has"},
        "--after": {
            "type": float,
            "default": 0.0,
            "metavar": "S",
            "help": "second after the first command from which on it has it",
        },
        "--motor": {
            "type": int,
            "default": 0,
            "choices": range(12),
            "metavar": "N",
            "help": "0 to 11, whose fault it is",
        },
        **OVERRIDES,
    },
)
def main(arguments: Arguments) -> None:
    """Play a robot, or move one that hangs; raises CmacexpError unless one of the three ways is asked for."""
    ways = (arguments.simulate, arguments.chirp, arguments.learn)
    CmacexpError.unless(sum(map(bool, ways)) == 1, "give one of --simulate, --chirp LOG and --learn LEG")
    (_play if arguments.simulate else _move_hung)(arguments)
