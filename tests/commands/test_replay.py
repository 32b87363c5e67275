"""Replay: recordings read back from the file and compared with the trace that another process left."""

import os
import signal
import socket
import subprocess
import sys
from functools import partial
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader
from support.command import cmacexp, python
from support.manifests import accept, change_manifest

from cmacexp.commands.viewer import DISPLAYS
from cmacexp.config import to_plain
from cmacexp.config.difference import labels
from cmacexp.data.folder import locked
from cmacexp.data.integrity import faults
from cmacexp.data.tables import steps_by_cycle
from cmacexp.recording.entities import FINENESS
from cmacexp.recording.window import MOST_STEPS, make_window, read_cycles

DRAWN = 0.51 * FINENESS
"""Rounding of what is drawn, m, and a little for single precision."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with runs of other processes: leg_cmac, leg_none, walk."""
    folder = tmp_path_factory.mktemp("runs")
    common = ["record=trace", "cycles=4"]
    for name, overrides in {
        "leg_cmac": ["scenario=one_leg"],
        "leg_none": ["scenario=one_leg", "feedforward=none"],
        "walk": ["scenario=quadruped", "cycles=2"],
    }.items():
        done = cmacexp(*common, *overrides, f"hydra.run.dir={folder / name}", folder=folder)
        assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def copy(runs, tmp_path):
    """``copy("leg_cmac")`` gives a run that the test may change."""

    def copied(name):
        subprocess.run(["cp", "-r", str(runs / name), str(tmp_path / name)], check=True)
        return tmp_path / name

    return copied


def replay(*arguments, folder):
    return python("-m", "cmacexp.replay", "--no-viewer", *map(str, arguments), folder=folder)


def rows(path, entity, component):
    """Steps and values (steps, ...) of one component of a recording, in the order of the steps."""
    chunks = RrdReader(path).stream().filter(content=f"/{entity}", has_timeline="step").to_chunks()
    found = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist() if component in row]
    found = sorted((row["step"], row[component]) for row in found)
    return np.array([step for step, _ in found]), np.array([value for _, value in found])


def lines(path, plot, root=""):
    """Steps and values (steps, lines) of a plot, such as leg_1/force."""
    return rows(path, f"{root}series", plot.replace("/", ":"))


def entities(path):
    return {chunk.entity_path for chunk in RrdReader(path).stream().to_chunks()}


def name_in(path):
    chunks = RrdReader(path).stream().filter(content="/__properties").to_chunks()
    found = [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]
    return next(row["RecordingInfo:name"][0] for row in found if "RecordingInfo:name" in row)


def leg_of(folder, number=1):
    trace = pd.read_parquet(folder / "trace.parquet")
    return trace[trace.leg == number]


def test_a_run_of_another_process_is_shown_as_its_trace_says(copy, tmp_path):
    folder = copy("leg_cmac")
    done = replay(folder, folder=tmp_path)
    assert done.stdout == f"{folder}/recording.rrd: one_leg leg_cmac, cycles 1 to 4, every step\n"
    trace = leg_of(folder)
    steps, force = lines(folder / "recording.rrd", "leg_1/force")
    assert (steps == np.arange(2400)).all()
    assert (force == trace[["force_desired", "force"]].to_numpy(np.float32)).all()
    _, error = lines(folder / "recording.rrd", "leg_1/error")
    expected = 1e3 * (trace[["x", "y"]].to_numpy() - trace[["x_desired", "y_desired"]].to_numpy())
    assert (error == expected.astype(np.float32)).all()
    _, torque = lines(folder / "recording.rrd", "leg_1/torque_2")
    assert (torque == trace[["tau_feedback_2", "tau_feedforward_2"]].to_numpy(np.float32)).all()
    _, foot = rows(folder / "recording.rrd", "world/feet", "Ellipsoids3D:centers")
    assert foot[:, 0, 0] == pytest.approx(trace.x.to_numpy(), abs=DRAWN)
    assert foot[:, 0, 2] == pytest.approx(0.5 - trace.y.to_numpy(), abs=DRAWN)
    assert python("-m", "cmacexp.verify", str(folder), folder=tmp_path).returncode == 0


def test_every_leg_of_a_walk_and_its_body_are_shown(copy, tmp_path):
    folder = copy("walk")
    assert replay(folder, folder=tmp_path).returncode == 0
    for number in (1, 2, 3, 4):
        _, force = lines(folder / "recording.rrd", f"leg_{number}/force")
        assert (force == leg_of(folder, number)[["force_desired", "force"]].to_numpy(np.float32)).all()
    body = pd.read_parquet(folder / "body.parquet")
    _, height = lines(folder / "recording.rrd", "body/height")
    assert height[:, 0] == pytest.approx(1e3 * body.height.to_numpy())


def test_on_a_slope_the_ground_is_drawn_below_the_feet_and_the_body_above_it(tmp_path):
    folder = tmp_path / "up"
    slope = ["terrain.slope=0.08", "terrain.slope_start=0.1"]
    done = cmacexp("scenario=quadruped", "cycles=1", *slope, f"hydra.run.dir={folder}", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    body, foot = pd.read_parquet(folder / "body.parquet"), leg_of(folder, 1)
    _, pose = rows(folder / "recording.rrd", "world/travel/body", "Transform3D:translation")
    assert pose.reshape(-1, 3)[:, 2] == pytest.approx(body.height.to_numpy(), abs=1e-6)
    _, below = rows(folder / "recording.rrd", "world/travel", "Transform3D:translation")
    expected = 0.08 * np.maximum(body.cog_x - 0.1, 0.0)
    assert below.reshape(-1, 3)[:, 2] == pytest.approx(expected.to_numpy(), abs=1e-6)
    _, feet = rows(folder / "recording.rrd", "world/feet", "Ellipsoids3D:centers")
    _, dents = rows(folder / "recording.rrd", "world/ground", "LineStrips3D:strips")
    feet, dents = feet[:, 0], dents[:, 0]
    surface = 0.08 * np.maximum(dents[..., 0] - 0.1, 0.0)
    assert dents[:, [0, -1], 2] == pytest.approx(surface[:, [0, -1]], abs=2.0 * DRAWN)
    dent = (surface - dents[..., 2])[:, 1]
    assert dent / dent.max() == pytest.approx(
        (foot.force / foot.force.max()).to_numpy(), abs=4.0 * DRAWN / dent.max()
    )
    assert dent.max() > 10.0 * foot.force.max() / 1e4
    pressing, above = (foot.force > 1.0).to_numpy(), feet[:, 2] - 0.08 * np.maximum(feet[:, 0] - 0.1, 0.0)
    assert above[pressing].max() < 4e-3  # the body's tilt moves the drawn foot along the slope
    assert "/world/slope" in entities(folder / "recording.rrd")


def test_a_window_of_cycles_thinned(copy, tmp_path):
    folder = copy("walk")
    done = replay(folder, "--cycles", "2", "--every", 7, folder=tmp_path)
    said = "quadruped walk, cycle 2, one step in 7 of 600"
    assert done.stdout == f"{folder}/recording.rrd: {said}; --every 1 shows all\n"
    assert name_in(folder / "recording.rrd") == said
    shown = slice(600, 1200, 7)
    steps, force = lines(folder / "recording.rrd", "leg_3/force")
    assert (steps == np.arange(1200)[shown]).all()
    assert (force == leg_of(folder, 3)[["force_desired", "force"]].to_numpy(np.float32)[shown]).all()
    _, height = lines(folder / "recording.rrd", "body/height")
    assert height[:, 0] == pytest.approx(1e3 * pd.read_parquet(folder / "body.parquet").height.to_numpy()[shown])
    assert python("-m", "cmacexp.verify", str(folder), folder=tmp_path).returncode == 0


def test_a_recording_that_is_there_is_kept_until_another_is_asked_for(copy, tmp_path):
    folder = copy("leg_none")
    replay(folder, "--cycles", "last2", folder=tmp_path)
    before = (folder / "recording.rrd").read_bytes()
    assert "recording.rrd: as it was built" in replay(folder, folder=tmp_path).stdout
    replay(folder, "--cycles", "1", "--out", "apart/first.rrd", folder=tmp_path)
    assert name_in(tmp_path / "apart" / "first.rrd") == "one_leg leg_none, cycle 1, every step"
    assert (folder / "recording.rrd").read_bytes() == before
    assert "cycles 1 to 4" in replay(folder, "--rebuild", folder=tmp_path).stdout


def test_a_recording_is_not_built_where_another_command_writes(copy, tmp_path):
    run = copy("leg_cmac")
    before = sorted(run.iterdir())
    with locked(run, "key"):
        refused = replay(run, folder=tmp_path)
    assert refused.returncode == 2
    assert (
        refused.stderr
        == f"error: DIR={run}: process {os.getpid()} writes here; wait until it has ended, or choose another\n"
    )
    assert sorted(run.iterdir()) == before
    assert replay(run, folder=tmp_path).returncode == 0
    assert not faults(run)
    assert sorted(run.iterdir()) == sorted([*before, run / "recording.rrd"])


def test_a_recording_of_the_user_is_not_replaced(copy, tmp_path):
    run = copy("leg_cmac")
    (run / "recording.rrd").write_text("mine")
    refused = replay(run, folder=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"error: DIR={run}: holds recording.rrd, which is not listed in")
    assert len(refused.stderr.splitlines()) == 1
    assert (run / "recording.rrd").read_text() == "mine"


def test_a_long_run_is_thinned_and_says_so(tmp_path):
    done = cmacexp("cycles=34", f"hydra.run.dir={tmp_path}/long", folder=tmp_path)
    assert "recording.rrd: one step in 2 of 20400" in done.stdout
    path = tmp_path / "long" / "recording.rrd"
    assert name_in(path) == "one_leg long, cycles 1 to 34, one step in 2 of 20400"
    assert (lines(path, "leg_1/force")[0] == np.arange(0, 20400, 2)).all()
    assert "every step\n" in replay(tmp_path / "long", "--every", 1, folder=tmp_path).stdout
    assert len(lines(path, "leg_1/force")[0]) == 20400


def test_runs_side_by_side_are_named_by_what_differs(runs, tmp_path):
    before = {path: path.read_bytes() for path in runs.rglob("*") if path.is_file()}
    done = replay(runs / "leg_none", runs / "leg_cmac", folder=tmp_path)
    path = tmp_path / "outputs" / "comparisons" / "leg_none-leg_cmac.rrd"
    assert done.stdout.endswith(
        "leg_none-leg_cmac.rrd: feedforward=none | feedforward=cmac, cycles 1 to 4, every step\n"
    )
    for number, name in ((1, "none"), (2, "cmac")):
        _, force = lines(path, "leg_1/force", f"{number}_feedforward_{name}/")
        assert (force == leg_of(runs / f"leg_{name}")[["force_desired", "force"]].to_numpy(np.float32)).all()
    assert {path: path.read_bytes() for path in runs.rglob("*") if path.is_file()} == before


def test_runs_of_different_machines_side_by_side(runs, tmp_path):
    done = replay(runs, "--cycles", "last", "--out", "all.rrd", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    found = entities(tmp_path / "all.rrd")
    assert {"/1_leg_cmac/series", "/2_leg_none/gait/1_leg", "/3_walk/events"} <= found
    # The walk took two cycles, so the last that all have is the second.
    steps, _ = lines(tmp_path / "all.rrd", "leg_1/force", "1_leg_cmac/")
    assert (steps == np.arange(600, 1200)).all()


@pytest.mark.parametrize("arguments", ["leg_cmac walk --cycles 3", "leg_cmac --web", "walk --meshes"])
def test_what_cannot_be_shown_is_one_line(arguments, runs):
    done = replay(*arguments.split(), folder=runs)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert not list(runs.rglob("*.rrd"))


def test_where_no_file_can_be_is_one_line(runs, tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder.rrd").mkdir()
    for out, named in (("file/film.rrd", "file"), ("folder.rrd", "folder.rrd")):
        refused = replay(runs / "leg_cmac", "--out", out, folder=tmp_path)
        assert (refused.returncode, len(refused.stderr.splitlines())) == (2, 1)
        assert refused.stderr.startswith(f"error: --out={named}: ")


def test_without_a_display_one_line_says_what_to_do(runs):
    environment = {name: value for name, value in os.environ.items() if name not in DISPLAYS}
    command = [sys.executable, "-m", "cmacexp.replay", "leg_cmac"]
    done = subprocess.run(command, cwd=runs, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "--web" in done.stderr
    assert "--no-viewer" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not list(runs.rglob("*.rrd"))


def test_the_viewer_is_served_to_this_machine_alone_until_interrupted(runs, tmp_path):
    command = [sys.executable, "-m", "cmacexp.replay", str(runs / "leg_none"), "--web", "--out", "one.rrd"]
    command += ["--cycles", "1"]
    pipe = subprocess.PIPE
    # Of a test that runs in the background SIGINT may be ignored, which its processes would inherit.
    listen = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True, preexec_fn=listen) as process:
        process.stdout.readline()
        address = urlsplit(process.stdout.readline().split()[0])
        assert address.hostname == "127.0.0.1"
        with urlopen(f"http://{address.netloc}/") as page:
            assert page.status == 200
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in errors  # the first viewer of a user greets there
    with socket.socket() as connection:
        assert connection.connect_ex((address.hostname, address.port)) != 0


def test_too_many_runs_are_one_line(runs, tmp_path):
    for number in range(7):
        subprocess.run(["cp", "-r", str(runs / "leg_none"), str(tmp_path / f"copy{number}")], check=True)
    done = replay(tmp_path, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: 7 runs: ")


def test_a_run_without_a_step_is_one_line(copy, tmp_path):
    folder = copy("leg_none")
    trace = pd.read_parquet(folder / "trace.parquet")
    trace.iloc[:0].to_parquet(folder / "trace.parquet")
    accept(folder, "trace.parquet")
    done = replay(folder, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {folder}: its trace kept none ")
    change_manifest(folder, steps=0)
    assert replay(folder, folder=tmp_path).stderr.startswith(f"error: {folder}: the run took no step")


def test_the_usual_thinning_keeps_within_the_most_steps(runs):
    kept = steps_by_cycle(runs / "leg_none")
    sharing = 3 * MOST_STEPS // 2400
    assert make_window(kept).every == 1
    assert make_window(kept, sharing=sharing).every == 3
    assert make_window(kept, sharing=sharing + 1).every == 4


@pytest.mark.parametrize(("text", "cycles"), [("3-5", (3, 5)), ("7", (7, 7)), ("last", (9, 9)), ("last9", (1, 9))])
def test_windows_of_cycles(text, cycles):
    assert read_cycles(text, 9) == cycles


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (["cmac.layers=8"], ["cmac.layers=16", "record=trace"], ["cmac.layers=8", "cmac.layers=16"]),
        (["cmac.inputs=[angle]"], ["feedforward=none", "cmac.inputs=[angle,velocity]"], None),
        (["feedforward=none"], ["feedforward=cmac"], ["feedforward=none", "feedforward=cmac"]),
        (["scenario=one_leg"], ["scenario=quadruped"], ["one_leg", "quadruped"]),
        (["record=full"], ["record=trace"], ["a", "b"]),
        (["terrain=patchy"], ["terrain=soft_flat", "seed=1", "cycles=2"], ["a", "b"]),
    ],
)
def test_names_of_runs_side_by_side(first, second, expected, make_config):
    expected = expected or [
        "feedforward=cmac cmac.inputs=[angle]",
        "feedforward=none cmac.inputs=[angle,velocity]",
    ]
    assert labels([to_plain(make_config(*overrides)) for overrides in (first, second)], ["a", "b"]) == expected


def test_a_recording_says_what_run_it_shows(runs, tmp_path):
    replay(runs / "leg_cmac", "--out", "one.rrd", folder=tmp_path)
    chunks = RrdReader(tmp_path / "one.rrd").stream().filter(content="/__properties/**").to_chunks()
    facts = {
        (chunk.entity_path, name): value[0]
        for chunk in chunks
        for row in chunk.to_record_batch().to_pylist()
        for name, value in row.items()
        if isinstance(value, list) and value
    }
    assert facts["/__properties/run", "status"] == "completed"
    assert facts["/__properties/run", "seed"] == 0
    assert facts["/__properties/config", "feedforward"] == "cmac"
    assert facts["/__properties/config", "cmac.layers"] > 0
    metrics = pd.read_parquet(runs / "leg_cmac" / "metrics.parquet")
    assert facts["/__properties/metrics", "force_rmse"] == metrics.force_rmse.iloc[-1]


@pytest.mark.parametrize("name", ["leg_none", "walk"])
def test_views_look_at_entities_of_the_run(name, copy, tmp_path):
    folder = copy(name)
    assert replay(folder, "--cycles", "2", folder=tmp_path).returncode == 0
    reader = RrdReader(folder / "recording.rrd")
    origins = set()
    for chunk in reader.stream(store=reader.blueprints()[0]).to_chunks():
        for row in chunk.to_record_batch().to_pylist():
            origins.update(origin.strip("/") for origin in row.get("ViewBlueprint:space_origin") or ())
    shown = {"series", "events", "key"}
    eyes = {f"world/travel/eyes/{eye}" for eye in ("front", "right_side", "top")}
    assert origins == shown | (
        {"gait", "world/travel", *eyes} if name == "walk" else {"world/travel/eyes/right_side"}
    )
