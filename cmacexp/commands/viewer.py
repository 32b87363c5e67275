"""Opening a recording in the Rerun viewer: in a window, or in the browser."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import quote

from cmacexp.errors import CmacexpError

HOST = "127.0.0.1"
"""The viewer and its servers listen to this machine alone."""
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
RERUN = (sys.executable, "-m", "rerun", "--bind", HOST)


def require_display() -> None:
    """Check that a window can be opened; raises CmacexpError on Linux without a display."""
    if sys.platform == "linux" and not any(os.environ.get(name) for name in DISPLAYS):
        raise CmacexpError(
            "no display (DISPLAY and WAYLAND_DISPLAY are not set): --web serves the viewer for a browser, "
            "--no-viewer only builds the recording"
        )


def open_window(shown: Path | str) -> int:
    """Open a recording, or what has an address, in the viewer, and wait until it is closed; its exit code."""
    return subprocess.call([*RERUN, str(shown)])


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind((HOST, 0))
        return int(listener.getsockname()[1])


def _answers(port: int) -> bool:
    with socket.socket() as connection:
        return connection.connect_ex((HOST, port)) == 0


def serve_web(shown: Path | str) -> int:
    """Serve the viewer, and a recording that has no address yet, until interrupted; the server's exit code."""
    page, data = _free_port(), _free_port()
    ports = ("--serve-web", "--web-viewer-port", str(page), "--port", str(data))
    # Its own group: Ctrl-C reaches this process alone, which then ends the server and what it has started.
    server = subprocess.Popen(
        [*RERUN, *ports, str(shown)], env={**os.environ, "RUST_LOG": "error"}, start_new_session=True
    )
    try:
        served = isinstance(shown, str)
        while server.poll() is None and not (_answers(page) and (served or _answers(data))):
            time.sleep(0.1)
        if server.poll() is None:
            source = quote(shown if isinstance(shown, str) else f"rerun+http://{HOST}:{data}/proxy", safe="")
            print(f"http://{HOST}:{page}/?url={source} (Ctrl-C ends it)", flush=True)
        return server.wait()
    finally:
        if server.poll() is None:
            os.killpg(server.pid, signal.SIGTERM)
            server.wait()
