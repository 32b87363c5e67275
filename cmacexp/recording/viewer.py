"""Rerun's own viewer, in a window or in a browser; it and its servers listen to this machine alone.

It is started as a command: only there can be said on which address it listens. ``rr.spawn``, ``rr.serve_grpc`` and
``rr.serve_web_viewer`` listen to all machines of the network.
"""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from cmacexp.data.run import Run
from cmacexp.data.tables import RECORDING_FILE
from cmacexp.errors import CmacexpError, require_extra

HOST = "127.0.0.1"
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
RERUN = (sys.executable, "-m", "rerun_cli", "--bind", HOST)
SERVE = ("--serve-web", "--web-viewer-port", "0", "--port", "0")
"""Ports are free ones, which Rerun chooses."""
HOSTS_VIEWER = {"RUST_LOG": "error,re_sdk::web_viewer=info", "NO_COLOR": "1"}
"""Makes Rerun log only errors, and where it hosts its viewer."""


def require_display() -> None:
    """Check that a window can be opened; raises CmacexpError on Linux without a display."""
    CmacexpError.unless(
        sys.platform != "linux" or any(os.environ.get(name) for name in DISPLAYS),
        "no display (DISPLAY and WAYLAND_DISPLAY are not set): --web serves the viewer for a browser, "
        "--no-viewer only builds the recording",
    )


def open_window(shown: Path | str) -> int:
    """Open a recording, or what has an address, in the viewer, and wait until it is closed; its exit code."""
    return subprocess.call([*RERUN, str(shown)])


def serve_web(shown: Path | str) -> int:
    """Serve the viewer, and a recording that has no address yet, until interrupted; the server's exit code.

    Its own process group: Ctrl-C reaches this process alone, which then ends the server and what it has started.
    """
    environment = {**os.environ, **HOSTS_VIEWER}
    with subprocess.Popen(
        [*RERUN, *SERVE, str(shown)], env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as server:
        try:
            for line in server.stderr or ():
                found = re.search(r"connect at (\S+)", line)
                print(f"{found[1]} (Ctrl-C ends it)" if found else line.rstrip(), flush=True)
            return server.wait()
        finally:
            if server.poll() is None:
                os.killpg(server.pid, signal.SIGTERM)


def view_run(run: Run) -> None:
    """Show a run: in a notebook below its cell, else in a window, until that is closed; its recording is built anew
    where it is not that of the run.

    Raises:
        CmacexpError: there is no display, or in a notebook no ``rerun-notebook``.
        BadRun: the run has nothing to show.
    """
    from cmacexp.recording.write import DEFAULT, ensure_recording, make_recording

    if "ipykernel" in sys.modules:
        require_extra("rerun_notebook")
        make_recording([run], DEFAULT)[0].notebook_show()
        return
    require_display()
    ensure_recording(run)
    open_window(run.folder / RECORDING_FILE)
