"""``python -m cmacexp.verify DIR...``: which runs are intact."""

from cmacexp.commands.command import FOLDERS, NOT_INTACT, Arguments, command
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import faults
from cmacexp.terminal.output import print_line, show_activity


@command(
    "verify", "Check which runs are intact: every file that their manifests list is present and unchanged.", FOLDERS
)
def main(arguments: Arguments) -> int:
    """Check the runs; the exit code is 0 if all are intact, 4 if one is not, 2 if there is none."""
    intact = True
    for folder in [result for given in arguments.folders for result in manifests.everything_below(given)]:
        with show_activity(f"checking {folder}"):
            reasons = faults(folder)
        intact = intact and not reasons
        state = "NOT INTACT" if reasons else f"intact ({manifests.read_file(folder / manifests.MANIFEST)['status']})"
        print_line(f"{folder}: {state}")
        for fault in reasons:
            print_line(f"  {fault}")
    return 0 if intact else NOT_INTACT
