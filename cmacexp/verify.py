"""``python -m cmacexp.verify DIR...``: which runs are whole."""

import argparse
import sys
from pathlib import Path

from cmacexp import manifest as manifests
from cmacexp.config import config_hash
from cmacexp.errors import BadRun
from cmacexp.files import sha256
from cmacexp.folders import command, runs_below

NOT_WHOLE = 4


def _config_hash(folder: Path) -> str | None:
    """Hash of the config that the manifest of a run holds; None without a readable manifest."""
    try:
        return config_hash(manifests.read(folder)["config"])
    except BadRun:
        return None


def faults(folder: Path) -> list[str]:
    """What keeps a run or a report from being whole; empty if it is."""
    try:
        manifest = manifests.read(folder)
    except BadRun as error:
        return [str(error).removeprefix(f"{folder}: ")]
    found = []
    for name, expected in manifest["files"].items():
        path = folder / name
        if not path.is_file():
            found.append(f"{name}: missing")
        elif sha256(path) != expected:
            found.append(f"{name}: changed since it was written")
    for name, expected in manifest.get("runs", {}).items():
        if _config_hash(folder / name) != expected:
            found.append(f"{name}: its config is not the one that the report tells of")
    return found


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
    return command("cmacexp.verify", "Tell which runs are whole.", _verify)


if __name__ == "__main__":
    sys.exit(main())
