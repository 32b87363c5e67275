"""The Rerun viewer, in a window or in a browser; it and its servers accept connections only from this machine.

It is started as a command, the only way to choose the address on which it listens: ``rr.spawn``, ``rr.serve_grpc``
and ``rr.serve_web_viewer`` accept connections from the whole network.
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
"""Options that serve the viewer; port 0 lets Rerun choose a free port."""
HOSTS_VIEWER = {"RUST_LOG": "error,re_sdk::web_viewer=info", "NO_COLOR": "1"}
"""Environment in which Rerun logs only errors and the address of the viewer."""


def require_display() -> None:
    """Check that a window can be opened; raises CmacexpError on Linux without a display."""
    CmacexpError.unless(
        sys.platform != "linux" or any(os.environ.get(name) for name in DISPLAYS),
        "no display (DISPLAY and WAYLAND_DISPLAY are not set): --web serves the viewer for a browser, "
        "--no-viewer only builds the recording",
    )


def open_window(recording: Path | str) -> int:
    """Open a recording, a file or an address, in the viewer, wait until it is closed, and return its exit code."""
    return subprocess.call([*RERUN, str(recording)])


def serve_web(recording: Path | str) -> int:
    """Serve the viewer with a recording, a file or an address, until interrupted; return the server's exit code.

    The server has its own process group: Ctrl-C reaches only this process, which then ends the whole group.
    """
    environment = {**os.environ, **HOSTS_VIEWER}
    with subprocess.Popen(
        [*RERUN, *SERVE, str(recording)], env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as server:
        try:
            for line in server.stderr or ():
                address = re.search(r"connect at (\S+)", line)
                print(f"{address[1]} (Ctrl-C ends it)" if address else line.rstrip(), flush=True)
            return server.wait()
        finally:
            if server.poll() is None:
                os.killpg(server.pid, signal.SIGTERM)


def view_run(run: Run) -> None:
    """Show a run in a notebook below the cell, or in a window until it is closed.

    The recording is rebuilt for a notebook, and elsewhere if it is missing or outdated.

    Raises:
        CmacexpError: there is no display or, in a notebook, no ``rerun-notebook``.
        BadRun: the trace of the run is empty.
    """
    from cmacexp.recording.write import DEFAULT, ensure_recording, make_recording

    if "ipykernel" in sys.modules:
        require_extra("rerun_notebook")
        make_recording([run], DEFAULT)[0].notebook_show()
        return
    require_display()
    ensure_recording(run)
    open_window(run.folder / RECORDING_FILE)
