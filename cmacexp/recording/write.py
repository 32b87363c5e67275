"""Write ``recording.rrd`` from a trace."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any

import rerun as rr

from cmacexp.files import write_atomically
from cmacexp.keep import Traces
from cmacexp.recording.blueprint import layout
from cmacexp.recording.ground import log_ground
from cmacexp.recording.scene import log_machine
from cmacexp.recording.series import log_series
from cmacexp.recording.view import view_of


class _NoPandas(MetaPathFinder):
    """Says that there is no pandas, to whoever has not imported it yet."""

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError("left out", name=fullname)


@contextmanager
def _pandas_left_out() -> Iterator[None]:
    """Keep pyarrow from importing pandas, which it does at its first conversion to know a Series if it sees one.

    None comes here, and the import takes half as long as a run. Asked for pandas later, pyarrow imports it.
    """
    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


@contextmanager
def _as_os_error(path: Path) -> Iterator[None]:
    """Rerun raises RuntimeError where a file cannot be written."""
    try:
        yield
    except RuntimeError as error:
        raise OSError(f"{path}: cannot be written ({str(error).splitlines()[0]})") from error


def write_recording(traces: Traces, config: dict[str, Any], path: Path) -> None:
    """Write the Rerun view of a run, whole or not at all.

    Args:
        traces: as the run left them, at least one step.
        config: as it stands in the manifest.
        path: of the ``.rrd`` file.
    """
    with write_atomically(path) as temporary, _pandas_left_out(), _as_os_error(path):
        view = view_of(traces, config)
        recording = rr.RecordingStream("cmacexp", recording_id=path.parent.name)
        recording.save(temporary, default_blueprint=layout(view))
        thinned = f", every {view.every} steps" if view.every > 1 else ""
        recording.send_recording_name(f"{config['scenario']} {path.parent.name}{thinned}")
        log_machine(recording, view)
        log_ground(recording, view)
        log_series(recording, view)
        recording.flush()
        recording.disconnect()
