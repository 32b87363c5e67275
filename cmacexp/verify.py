"""``python -m cmacexp.verify DIR...``: which runs are intact."""

import argparse
import sys

from cmacexp.cli.command import command
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import everything_below
from cmacexp.data.integrity import faults

NOT_INTACT = 4


def _verify(arguments: argparse.Namespace) -> int:
    intact = True
    for folder in [run for given in arguments.folders for run in everything_below(given)]:
        found = faults(folder)
        intact = intact and not found
        state = "NOT INTACT" if found else f"intact ({manifests.read(folder)['status']})"
        print(f"{folder}: {state}")
        for fault in found:
            print(f"  {fault}")
    return 0 if intact else NOT_INTACT


def main() -> int:
    """Run the command; exit code 0 if all runs are intact, 4 if one is not, 2 if there is none."""
    return command("cmacexp.verify", "Check which runs are intact: every file is present and unchanged.", _verify)


if __name__ == "__main__":
    sys.exit(main())
