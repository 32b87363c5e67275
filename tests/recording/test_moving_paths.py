"""A plan that moves from cycle to cycle: recordings draw of each cycle what was desired in it."""

import rerun as rr
from numpy.testing import assert_allclose
from rerun.chunk import RrdReader
from support.moving_plans import make_traces
from support.views import STEPS

from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import make_view
from cmacexp.recording.scene import log_machine


def test_the_desired_path_of_a_recording_follows_the_cycle_at_the_cursor(tmp_path):
    view = make_view(*make_traces((0.0, 0.01, 0.01), (0.0, 15.0, 15.0)))
    recording, path = rr.RecordingStream("test", recording_id="moving"), tmp_path / "moving.rrd"
    memory = recording.memory_recording()
    log_machine(Entities(recording, view), view)
    path.write_bytes(memory.drain_as_bytes())
    chunks = RrdReader(path).stream().filter(content="/world/travel/body/path/desired").to_chunks()
    rows = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist() if row.get("step") is not None]
    assert [row["step"] for row in rows] == [0, STEPS, 2 * STEPS]
    for row in rows:
        shown = slice(row["step"], row["step"] + STEPS)
        for leg, strip in zip(view.legs, row["LineStrips3D:strips"], strict=True):
            assert_allclose(strip, leg.foot("_desired")[shown], atol=1e-6)
