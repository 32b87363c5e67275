"""``python -m cmacexp.verify DIR...``: which runs are whole."""

import argparse
import sys

from cmacexp.cli.command import command
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import runs_below
from cmacexp.data.integrity import faults

NOT_WHOLE = 4


def _verify(arguments: argparse.Namespace) -> int:
    whole = True
    for folder in [run for given in arguments.folders for run in runs_below(given, reports=True)]:
        found = faults(folder)
        whole = whole and not found
        status = "NOT WHOLE" if found else manifests.read(folder)["status"]
        print(f"{folder}: {status}")
        for fault in found:
            print(f"  {fault}")
    return 0 if whole else NOT_WHOLE


def main() -> int:
    """Run the command; exit code 0 if all runs are whole, 4 if one is not, 2 if there is none."""
    return command("cmacexp.verify", "Check which runs are whole: every file present and unchanged.", _verify)


if __name__ == "__main__":
    sys.exit(main())
