"""``python -m cmacexp.verify DIR...``: checks the integrity of runs."""

from cmacexp.commands.command import FOLDERS, NOT_INTACT, Arguments, command
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import faults
from cmacexp.terminal.output import print_line, show_activity


@command(
    "verify",
    "Check that runs are intact: every file in their manifests is present and unchanged.",
    FOLDERS,
)
def main(arguments: Arguments) -> int:
    """Check the runs; return 0 if all are intact, else 4. Raises CmacexpError, exit code 2, if there is no run."""
    intact = True
    for folder in [result for parent in arguments.folders for result in manifests.everything_below(parent)]:
        with show_activity(f"checking {folder}"):
            reasons = faults(folder)
        intact = intact and not reasons
        state = "NOT INTACT" if reasons else f"intact ({manifests.read_file(folder / manifests.MANIFEST)['status']})"
        print_line(f"{folder}: {state}")
        for fault in reasons:
            print_line(f"  {fault}")
    return 0 if intact else NOT_INTACT
