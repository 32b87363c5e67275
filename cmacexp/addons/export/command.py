"""``cmacexp export``: writes a run for other programs: C, wide tables, MCAP."""

from pathlib import Path

from cmacexp.addons.export.tables import write_mcap, write_wide
from cmacexp.commands.command import Arguments, command, make_flag
from cmacexp.data.folder import OUT_KEY, require_no_link
from cmacexp.data.manifest import is_run, name_of, require_place
from cmacexp.data.run import Run
from cmacexp.data.weights import WEIGHTS
from cmacexp.errors import CmacexpError, require
from cmacexp.terminal.output import print_line, show_activity


def _find_place(arguments: Arguments) -> Path:
    """The folder to write to; never that of a run, which stays as its run wrote it."""
    if arguments.out is None:
        return require_no_link(Path(f"export-{name_of(arguments.folder)}"))
    folder = require_place(OUT_KEY, arguments.out)
    require(not is_run(folder), OUT_KEY, folder, "is the folder of a run, which stays as it is; choose another")
    return folder


def _check_formats(arguments: Arguments) -> None:
    """Refuse a command that writes nothing, or that has options of C code without it; raises CmacexpError."""
    c, of_c = arguments.c, arguments.single or arguments.path or arguments.law
    CmacexpError.unless(c or arguments.wide or arguments.mcap, "what to write is missing: add --c, --wide or --mcap")
    CmacexpError.unless(c or not of_c, "--single, --path and --law are options of --c: add --c")
    CmacexpError.unless(not (arguments.single and arguments.law), "--law is in double precision: leave out --single")


@command(
    "export",
    "Write a stored run for other programs: C code of its network, or its tables.",
    {
        "folder": {"type": Path, "metavar": "DIR", "help": "a run"},
        "--c": make_flag("cmac_leg.h, cmac_leg.c and main.c, which checks itself"),
        "--single": make_flag("the C code in single precision"),
        "--path": make_flag("the C code for the planned path alone: little memory"),
        "--law": make_flag("the C code of the whole control law, with --path"),
        "--wide": make_flag("the trace as a table with one row a step"),
        "--mcap": make_flag("the trace as MCAP"),
        "--out": {"type": Path, "metavar": "FOLDER", "help": "where to write (default: export-NAME OF DIR)"},
    },
)
def main(arguments: Arguments) -> None:
    """Write the files, and print their names."""
    _check_formats(arguments)
    run, out = Run(arguments.folder), _find_place(arguments)
    _ = run.manifest
    with show_activity(f"exporting {run.folder}"):
        written = []
        if arguments.c:
            from cmacexp.addons.export.c_code import write_c
            from cmacexp.addons.export.c_law import describe_law

            law = describe_law(run) if arguments.law else None
            written.append(write_c(run, out, arguments.single, arguments.path, law))
        if arguments.wide:
            written.append(write_wide(run, out))
        if arguments.mcap:
            written.append(write_mcap(run, out))
    if arguments.c and WEIGHTS not in run.manifest["files"]:
        print_line(
            "warning: the run stored no weights (record.weights=true): the network starts from zero", error=True
        )
    for path in written:
        print_line(str(path))
