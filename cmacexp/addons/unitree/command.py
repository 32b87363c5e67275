"""``cmacexp robot``: simulate a robot on this computer for plant=unitree, or move a robot that hangs."""

from functools import partial
from pathlib import Path
from threading import Thread
from typing import Any

from omegaconf import OmegaConf

from cmacexp.addons.unitree.faults import KINDS, NO_FAULT, Fault
from cmacexp.addons.unitree.hung import draw_chirp, learn_strokes, make_memory
from cmacexp.addons.unitree.log import recover_log
from cmacexp.addons.unitree.network import LOOPBACK
from cmacexp.addons.unitree.service import serve_mode
from cmacexp.addons.unitree.simulated import SimulatedRobot, play
from cmacexp.commands.command import OVERRIDES, Arguments, command, make_flag
from cmacexp.commands.robots import quote_value
from cmacexp.config import config_folder
from cmacexp.config.compose import compose_config
from cmacexp.config.machine import LEG_NAMES
from cmacexp.errors import CmacexpError
from cmacexp.metrics.registry import format_number
from cmacexp.terminal.messages import print_table
from cmacexp.terminal.output import print_line, show_activity

PLAYED = [
    "scenario=robot", "machine=go2", "plant=mujoco_robot_rigid", "plant/as_built=go2", "actuator=go2",
    "controller=drives", "feedforward=none", "sensors=proprioceptive",
]  # fmt: skip
"""Default overrides of the simulated robot."""

HUNG = ["scenario=robot", "machine=go2", "plant=unitree", "controller=drives"]
"""Default overrides of the controller of a robot that hangs."""

FAULTS = "; ".join(f"{name}: {meaning}" for name, meaning in KINDS.items())


def _move_hung(arguments: Arguments) -> None:
    """Move a robot that hangs: draw a chirp, or let a leg learn; print what follows."""
    from cmacexp.loop.scenario import make_scenario

    log = [f"plant.log={quote_value(arguments.chirp)}"] if arguments.chirp else []
    scenario = make_scenario(compose_config([*HUNG, *log, f"plant.domain={arguments.domain}", *arguments.overrides]))
    if scenario.fault is not None:
        raise scenario.fault
    plant: Any = scenario.plant  # plant=unitree
    move: Any = draw_chirp
    if arguments.learn:
        leg = LEG_NAMES.index(arguments.learn)
        setup = scenario.setup
        move = partial(learn_strokes, leg=leg, memory=make_memory(), lead=setup.lead, rate=setup.rate)
    is_safe = False
    try:
        with show_activity("the joints are checked, then move"):
            strokes = plant.move_hung(move)
        is_safe = True
    finally:
        plant.end_run(is_safe)
    if arguments.chirp:
        print_line(f"{arguments.chirp}: python -m cmacexp.gap {arguments.chirp} --robot go2")
    else:
        rows = [[str(k), *map(format_number, row * [1e3, 1.0])] for k, row in enumerate(strokes, start=1)]
        print_table(["stroke", "joint error, mrad", "feedback, N m"], rows)


def _play(arguments: Arguments) -> None:
    """Simulate a robot and print one line about the course of the simulation."""
    config = compose_config([*PLAYED, *arguments.overrides])
    fault = Fault(arguments.fault, round(arguments.after / config.sampling_period), arguments.motor, arguments.lasts)
    crouch = OmegaConf.load(config_folder() / "plant" / "unitree.yaml").crouch
    robot = SimulatedRobot(config, not arguments.lying, list(crouch))
    if arguments.sport:
        Thread(target=serve_mode, args=(LOOPBACK, arguments.domain, "normal"), daemon=True).start()
    print_line(play(robot, arguments.domain, fault, arguments.patient))


@command(
    "robot",
    f"Simulate a robot on this computer's loopback for plant=unitree, or move a robot that hangs. Faults: {FAULTS}.",
    {
        "--simulate": make_flag("simulate a Go2; exit when commands stop"),
        "--chirp": {
            "metavar": "LOG",
            "help": "move all joints of a robot that hangs and write LOG, for cmacexp gap LOG",
        },
        "--learn": {"metavar": "LEG", "choices": LEG_NAMES, "help": "let one leg of a robot that hangs learn"},
        "--recover": {"metavar": "LOG", "help": "write LOG from LOG.partial, which a killed run left"},
        "--domain": {"type": int, "default": 0, "metavar": "N", "help": "DDS domain, equal to plant.domain (0)"},
        "--lying": make_flag("start on the ground, not hanging"),
        "--sport": make_flag("a motion program runs on it, until it is asked to end it"),
        "--patient": make_flag("wait for each command, not in real time"),
        "--fault": {"default": NO_FAULT, "metavar": "KIND", "help": "inject this fault (none)"},
        "--after": {
            "type": float,
            "default": 0.0,
            "metavar": "S",
            "help": "time of the fault after the first command, s (0)",
        },
        "--lasts": {"type": float, "default": 0.1, "metavar": "S", "help": "duration of a stall, s (0.1)"},
        "--motor": {
            "type": int,
            "default": 0,
            "choices": range(12),
            "metavar": "N",
            "help": "faulty motor, 0 to 11 (0)",
        },
        **OVERRIDES,
    },
)
def main(arguments: Arguments) -> None:
    """Simulate a robot, or move one that hangs; raise CmacexpError unless one of four modes is chosen."""
    modes = (arguments.simulate, arguments.chirp, arguments.learn, arguments.recover)
    CmacexpError.unless(
        sum(map(bool, modes)) == 1, "give one of --simulate, --chirp LOG, --learn LEG and --recover LOG"
    )
    if arguments.recover:
        print_line(f"{arguments.recover}: {recover_log(Path(arguments.recover))} rows")
        return
    (_play if arguments.simulate else _move_hung)(arguments)
