"""``python -m cmacexp.replay DIR``: rebuild the recording from the trace if it is missing, and open the viewer."""

import argparse
import subprocess
import sys
from pathlib import Path

from cmacexp import manifest as manifests
from cmacexp.errors import BadRun
from cmacexp.folders import command, runs_below
from cmacexp.keep import RECORDING, read_traces


def rebuild(folder: Path) -> Path:
    """Write the recording of a run from its trace.

    Raises:
        BadRun: it has no readable trace or manifest.
    """
    from cmacexp.recording import write_recording

    traces = read_traces(folder)
    if not traces.legs.num_rows:
        raise BadRun(f"{folder}: the run took no step, there is nothing to show")
    write_recording(traces, manifests.read(folder)["config"], folder / RECORDING)
    manifests.update_files(folder, [RECORDING])
    return folder / RECORDING


def open_viewer(recordings: list[Path]) -> int:
    """Open recordings in the Rerun viewer, and wait until it is closed."""
    return subprocess.call([sys.executable, "-m", "rerun", "--bind", "127.0.0.1", *map(str, recordings)])


def _replay(arguments: argparse.Namespace) -> int:
    recordings = []
    for folder in [run for given in arguments.folders for run in runs_below(given)]:
        path = folder / RECORDING
        recordings.append(rebuild(folder) if arguments.rebuild or not path.exists() else path)
        print(path)
    return 0 if arguments.no_viewer else open_viewer(recordings)


def main() -> int:
    """Run the command."""
    options = [("--no-viewer", "only rebuild what is missing"), ("--rebuild", "rebuild even if it is there")]
    return command("cmacexp.replay", "Look at runs in the Rerun viewer.", _replay, options)


if __name__ == "__main__":
    sys.exit(main())
