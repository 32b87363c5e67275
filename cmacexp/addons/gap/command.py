"""``cmacexp gap``: compare a log of a robot with its model, identify and validate its joints, and score learners."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote

import numpy as np

from cmacexp.addons.gap.faults import KINDS, Unfit, check_length
from cmacexp.addons.gap.log import Log
from cmacexp.addons.gap.machine import Machine, read_machine
from cmacexp.addons.gap.matching import plain
from cmacexp.addons.gap.readers import load_reader
from cmacexp.addons.gap.reading import read_log
from cmacexp.commands.command import Arguments, OptionTable, command, make_flag
from cmacexp.data.folder import choose_page_folder
from cmacexp.errors import BadInput, require, require_name
from cmacexp.terminal.messages import print_table
from cmacexp.terminal.output import print_line, show_progress

FOLDER = Path("outputs/gap")
SEVERAL = {"action": "append", "default": []}
"""Settings of an option that can be given more than once."""
LOG_OPTIONS: OptionTable = {
    "--names": {
        **SEVERAL,
        "metavar": "WHAT=COLUMN",
        "help": "columns, such as angle=pos_{joint},command=cmd_{joint}, or their numbers, time=1,angle=2-7",
    },
    "--units": {**SEVERAL, "metavar": "WHAT=UNIT", "help": "units of columns, such as angle=deg,time=ms"},
    "--joints": {**SEVERAL, "metavar": "LOG=MODEL", "help": "joint of the model for a joint of the log"},
    "--leave-out": {"metavar": "JOINTS", "help": "joints of the log to ignore, separated by commas"},
    "--lean": {"metavar": "ROLL,PITCH", "help": "lean of a base that is not level, about x, then y, degrees"},
    "--rate": {"type": float, "metavar": "HZ", "help": "rows a second of a log without times"},
    "--accept": {"metavar": "KINDS", "help": "kinds of faults that become notes, separated by commas"},
    "--kp": {"help": "stiffness gains of the drives, N m/rad: one number, or one per joint, separated by commas"},
    "--kd": {"help": "damping gains of the drives, N m s/rad: one number, or one per joint"},
    "--reader": {
        "metavar": "FILE.py:FUNCTION",
        "help": "function that reads another format, path to columns by name",
    },
}
"""Options that say how a log is read."""


def _read_pairs(texts: Sequence[str], key: str) -> dict[str, str]:
    """Return the values of ``NAME=VALUE`` by name, from texts with several pairs separated by commas.

    Raises BadInput for a text of another form; ``key`` is the option that it names.
    """
    pairs = [pair for pair in ",".join(texts).split(",") if pair]
    for pair in pairs:
        require("=" in pair, key, pair, "must be NAME=VALUE, several separated by commas")
    return dict(pair.split("=", 1) for pair in pairs)


def _read_gain(text: str | None, key: str) -> list[float]:
    try:
        return [] if text is None else [float(number) for number in text.split(",")]
    except ValueError as error:
        raise BadInput(key, text, "must be numbers, separated by commas") from error


def read_given(arguments: Arguments, files: Sequence[Path]) -> tuple[Log, Machine]:
    """Read the log in ``files`` and the model of its robot, as the options of LOG_OPTIONS say; raises BadInput."""
    gains = {key: _read_gain(vars(arguments)[key], f"--{key}") for key in ("kp", "kd")}
    left_out: list[str] = [] if arguments.leave_out is None else arguments.leave_out.split(",")
    first, *others = files
    log = read_log(
        first,
        _read_pairs(arguments.names, "--names"),
        _read_pairs(arguments.units, "--units"),
        {key: gain for key, gain in gains.items() if gain},
        None if arguments.reader is None else load_reader(arguments.reader),
        left_out,
        arguments.rate,
        others,
    )
    check_length(log)
    if lean := _read_gain(arguments.lean, "--lean"):
        require(len(lean) == 2, "--lean", arguments.lean, "must be two angles: ROLL,PITCH")
        log = log.lean(*np.radians(lean))
    still = [joint for joint, values in zip(log.joints, log.angle.T, strict=True) if (values == values[0]).all()]
    pairs = _read_pairs(arguments.joints, "--joints")
    machine = read_machine(arguments.robot, log.joints, pairs, left_out, still)
    if machine.absent:
        absent = ", ".join(machine.absent)
        log = log.leave_out(machine.absent).note(f"The model has no joint {absent}: left out, and taken as held.")
    numbered = [
        f"{name} is {joint}"
        for name, joint in zip(log.joints, machine.joints, strict=True)
        if name not in pairs and plain(name) not in plain(joint)
    ]
    return log.note(f"Joints by number or order: {', '.join(numbered)}.") if numbered else log, machine


def read_accepted(arguments: Arguments) -> list[str]:
    """Return the kinds of faults that ``--accept`` makes notes; raises BadInput for one that does not exist."""
    kinds: list[str] = [] if arguments.accept is None else arguments.accept.split(",")
    for kind in kinds:
        require_name("--accept", kind, KINDS)
    return kinds


def format_next(arguments: Arguments, options: Mapping[str, Sequence[str]]) -> str:
    """Format the command of the ``arguments`` with further values of ``options``, with which it goes on."""
    given: dict[str, list[str]] = {"--robot": [str(arguments.robot)]}
    for option in [*LOG_OPTIONS, "--out"]:
        value = vars(arguments)[option.strip("-").replace("-", "_")]
        values = value if isinstance(value, list) else [] if value is None else [str(value)]
        given[option] = [*values * (option != "--rate" or option not in options), *options.get(option, ())]
    words = [word for option, values in given.items() if values for word in (option, quote(",".join(values)))]
    quick = ["--quick"] if arguments.quick else []
    return " ".join(["cmacexp gap", *(quote(str(file)) for file in arguments.log), *words, *quick])


@command(
    "gap",
    "Read a log of a robot, identify its joints, validate them on strokes that identification did not see, and "
    "report how much of the feedback torque learners would remove.",
    {
        "log": {
            "type": Path,
            "nargs": "+",
            "metavar": "LOG",
            "help": "Parquet, CSV, NPZ, MAT, HDF5, JSON, MCAP or bag of ROS; other formats: --reader; further files "
            "have other columns of the same rows",
        },
        "--robot": {"required": True, "help": "go2 or another option of conf/machine, or an MJCF or URDF file"},
        **LOG_OPTIONS,
        "--quick": make_flag("skip identification"),
        "--out": {"type": Path, "metavar": "FOLDER", "help": f"folder of the page ({FOLDER}/NAME OF THE LOG)"},
    },
)
def main(arguments: Arguments) -> None:
    """Compare a log with a model; write the page and print its summary."""
    from cmacexp.addons.gap.analysis import begin
    from cmacexp.addons.gap.page import PARAMETERS, summarise, tabulate_parameters, write_page
    from cmacexp.addons.gap.validation import identify

    out = choose_page_folder(arguments.out, FOLDER / arguments.log[0].stem)
    log, machine = read_given(arguments, arguments.log)
    with show_progress(f"replaying {arguments.log[0].name} through {arguments.robot}", 1) as set_done:
        try:
            gap = begin(log, machine, set_done, read_accepted(arguments))
        except Unfit as unfit:
            key, value, faults, options = unfit.args
            raise BadInput(key, value, f"{faults}: {format_next(arguments, options)}") from unfit
    page = write_page(gap, out)
    if gap.replays and not arguments.quick:
        print_line(f"{page}: identification follows, a minute or two")
        with show_progress("identifying", 1) as set_done:
            identify(gap, set_done)
        page = write_page(gap, out)
    print_line(summarise(gap.values))
    columns = ["predictor", "left\n%", "from\n%", "to\n%", *["fastest\n%"] * gap.signals.repeats]
    rows = [
        [name, *(f"{left[key]:.1f}" for key in ("value", "low", "high")), f"{left['fastest']['value']:.1f}"]
        for name, left in sorted(gap.values["left"].items(), key=lambda item: float(item[1]["value"]))
    ]
    print_table(columns, [row[: len(columns)] for row in rows])
    if "parameters" in gap.values:
        print_table(PARAMETERS, tabulate_parameters(gap.values))
    for note in gap.values["notes"]:
        print_line(f"note: {note}")
    print_line(str(page))
