"""``cmacexp export``: write a run for other programs, as C code, wide tables or MCAP."""

from pathlib import Path

from cmacexp.addons.export.tables import write_mcap, write_wide
from cmacexp.commands.command import Arguments, command, make_flag, parse_folder
from cmacexp.data.folder import OUT_KEY, require_no_link
from cmacexp.data.manifest import is_run, name_of, require_place
from cmacexp.data.run import Run
from cmacexp.data.weights import WEIGHTS
from cmacexp.errors import CmacexpError, require
from cmacexp.terminal.output import print_line, show_activity


def _choose_folder(arguments: Arguments) -> Path:
    """Return the output folder; raises BadInput if it is the folder of a run, which export must not change."""
    if arguments.out is None:
        return require_no_link(Path(f"export-{name_of(arguments.folder)}"))
    folder = require_place(OUT_KEY, arguments.out)
    require(not is_run(folder), OUT_KEY, folder, "is the folder of a run, which stays as it is; choose another")
    return folder


def _check_formats(arguments: Arguments) -> None:
    """Raise CmacexpError if no format is chosen, or if options of the C code exclude each other or lack ``--c``."""
    has_c_options = arguments.single or arguments.path or arguments.law
    CmacexpError.unless(
        arguments.c or arguments.wide or arguments.mcap, "what to write is missing: add --c, --wide or --mcap"
    )
    CmacexpError.unless(arguments.c or not has_c_options, "--single, --path and --law are options of --c: add --c")
    CmacexpError.unless(not (arguments.single and arguments.law), "--law is in double precision: leave out --single")


@command(
    "export",
    "Export a stored run for other programs: its network or control law as C code, or its trace.",
    {
        "folder": {"type": parse_folder, "metavar": "DIR", "help": "folder of a run; latest: the newest"},
        "--c": make_flag("write cmac_leg.h, cmac_leg.c and main.c, a program that checks them"),
        "--single": make_flag("write the C code in single precision"),
        "--path": make_flag("restrict the C code to the planned path, which needs little memory"),
        "--law": make_flag("also write the whole control law in C; implies --path"),
        "--wide": make_flag(
            "write the trace as a Parquet table of numbers, one row per step, for PlotJuggler and others"
        ),
        "--mcap": make_flag("write the trace as MCAP"),
        "--out": {
            "type": Path,
            "metavar": "FOLDER",
            "help": "output folder (default: export-NAME, for DIR called NAME)",
        },
    },
)
def main(arguments: Arguments) -> None:
    """Write the chosen files and print their names."""
    _check_formats(arguments)
    run = Run(arguments.folder)
    out = _choose_folder(arguments)
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
