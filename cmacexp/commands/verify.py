"""``python -m cmacexp.verify DIR...``: which runs are intact."""

from cmacexp.commands.command import FOLDERS, NOT_INTACT, Arguments, Parser
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import faults
from cmacexp.terminal.output import print_line, show_activity


def _verify(arguments: Arguments) -> int:
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


def main() -> int:
    """Run the command; returns its exit code: 0 if all is intact, 4 if something is not, 2 if there is nothing."""
    return Parser(
        "cmacexp.verify",
        "Check which runs are intact: every file that their manifests list is present and unchanged.",
        FOLDERS,
    ).run(_verify)
