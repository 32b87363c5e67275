"""Write ``recording.rrd`` from a trace."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import rerun as rr

from cmacexp.files import write_atomically
from cmacexp.recording.blueprint import one_leg
from cmacexp.recording.scene import log_scene
from cmacexp.recording.series import log_series
from cmacexp.recording.view import view_of


def write_recording(trace: pa.Table, config: dict[str, Any], path: Path) -> None:
    """Write the Rerun view of a run, whole or not at all.

    Args:
        trace: as the run left it, at least one step.
        config: as it stands in the manifest.
        path: of the ``.rrd`` file.
    """
    view = view_of(trace, config)
    with write_atomically(path) as temporary:
        recording = rr.RecordingStream("cmacexp", recording_id=path.parent.name)
        recording.save(temporary, default_blueprint=one_leg(view))
        recording.send_recording_name(f"{config['scenario']} {path.parent.name}")
        log_scene(recording, view)
        log_series(recording, view)
        recording.flush()
        recording.disconnect()
