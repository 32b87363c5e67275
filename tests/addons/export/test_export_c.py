"""The C code of a network: it compiles without a warning, agrees bit for bit, and takes only numbers from a run."""

import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from support.command import call, python
from support.doors import BadInput, BadRun
from support.manifests import accept, change_manifest
from support.robots import OWN

import cmacexp
from cmacexp.addons.export.c_code import FILES, LAW_FILES, write_c
from cmacexp.addons.export.network import read_network, run_steps

pytestmark = pytest.mark.ci
COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
# CI has a C compiler; a computer of a user need not, and the tests that compile nothing run there too.
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="checks C code: needs a C compiler")
FLAGS = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Werror"]
FLAGS += os.environ.get("CFLAGS", "").split()  # sanitizers at night
SHORT = ("record=metrics", "record.weights=true", "cycles=1", "learning.start_cycle=1", "warn=false")
DENSE = ("cmac.addressing=dense", "cmac.inputs=[angle]", "cmac.displacement=odd_lattice")
SMOOTH = ("cmac.receptive_field=cubic", "learning.rule=weight_smoothing", "cmac.displacement=parks_militzer")
DECAYING = ("learning.rule=decaying_rate", "learning.decay=0.5")
ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}", "cmac=phase", "learning.rule=leakage")
CASES = {
    "hashed": ((), {}),
    "hashed single": ((), {"single": True}),
    "hashed path": ((), {"one_path": True}),
    "dense": ((*DENSE, "learning.rule=e_modification", "learning.lead=3"), {}),
    "smooth single": ((*SMOOTH, "learning.lead=-1"), {"single": True}),
    "visited": (("cmac.addressing=visited", "cmac.receptive_field=linear", *DECAYING), {}),
    "quadruped": (("scenario=quadruped", "learning.rule=normalised", "learning.lead=1"), {"one_path": True}),
    "robot single": (
        (*ROBOT, "gait.cycle_time=0.4", "gait.stroke=0.02", "gait.lift=0.01", "gait.allow_unstable=true"),
        {"single": True},
    ),
    "rbf": (("feedforward=rbf", "learning.lead=-3"), {}),
    "model": (("feedforward=cmac_on_model", "learning.rule=dead_zone"), {}),
}
STEPPING = (*ROBOT, "gait.cycle_time=0.4", "gait.stroke=0.02", "gait.lift=0.01", "gait.allow_unstable=true")
PLANNED = (*STEPPING, "force_control.load_sharing=dynamic")
LAWS = {
    "leg": ("learning=lasting", "actuator.torque_limit=2", "actuator.rate_limit=100", "learning.rule=leakage"),
    "leg from nothing": ("force_control=explicit", "reference=aware", "learning.rule=decaying_rate"),
    "leg that damps": ("learning=lasting", "force_control=damping", "feedforward=rbf", "actuator.delay=2"),
    "quadruped": ("scenario=quadruped", "learning=lasting", "posture.rate_gain=0.5"),
    "robot with drives": (*PLANNED, "controller=drives", "feedforward=cmac_on_model", "sensors=proprioceptive"),
    "robot": PLANNED,
}
LACKING = {
    "force_control.load_sharing=adaptive": STEPPING,
    "plausibility.enabled=true": (),
    "learning.guard=refine": (),
    "learning.lead=estimate": ("learning.guard=freeze", "cycles=11"),
    "sensors.velocity.lag=0.01": ("sensors=real",),
    "machine.kind=point_mass": ("scenario=force_step", "feedforward=cmac"),
}
"""What no C has a part of, and what that needs."""


@pytest.fixture(scope="module")
def run_of(stored):
    """A short run with these overrides."""
    return lambda *overrides: stored(*SHORT, *overrides)


@pytest.fixture
def copy(run_of, tmp_path):
    """A run of one leg that a test may change, in a folder whose name would be code."""
    return shutil.copytree(run_of().folder, tmp_path / 'x */ #error injected "')


def check(folder, files=FILES[1:]):
    """Compile the C code without a warning; how its check ends."""
    command = [COMPILER, *FLAGS, "-o", folder / "check", *(folder / name for name in files), "-lm"]
    compiled = subprocess.run(command, capture_output=True, text=True)
    assert compiled.returncode == 0, compiled.stderr
    return subprocess.run([folder / "check"], capture_output=True, text=True)


def alter(source, pattern, new):
    """Change the one place of a file that fits a pattern."""
    changed, count = re.subn(pattern, new, source.read_text(), count=1)
    assert count == 1
    source.write_text(changed)


@needs_compiler
@pytest.mark.parametrize("case", CASES)
def test_c_computes_what_python_does(case, run_of, tmp_path):
    overrides, options = CASES[case]
    header = write_c(run_of(*overrides), tmp_path, **options).read_text()
    done = check(tmp_path)
    assert done.returncode == 0, done.stdout
    assert done.stdout.rstrip().endswith("state " + re.search(r"Memory: (\d+ bytes)", header)[1])


@needs_compiler
def test_a_changed_weight_and_a_changed_law_fail(run_of, tmp_path):
    weight = r"(learnt\[LEARNT\][^{]*\{\s*\{-?0x1\.)(.)"
    for old, new in [(weight, r"\g<1>8"), (r"rate \* error", "rate * error * error")]:
        alter(write_c(run_of(), tmp_path).with_name("cmac_leg.c"), old, new)
        assert check(tmp_path).returncode == 1


@needs_compiler
@pytest.mark.parametrize("case", LAWS)
def test_c_runs_the_law_that_python_runs(case, stored, tmp_path):
    keeps = f"record.weights={'nothing' not in case}"
    run = stored("warn=false", "record=metrics", keeps, "cycles=2", "learning.start_cycle=2", *LAWS[case])
    done = call("export", run.folder, "--c", "--law", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    agrees = check(tmp_path, ("cmac_leg.c", *LAW_FILES[1:]))
    assert agrees.returncode == 0, agrees.stdout
    assert ("lasting" in str(LAWS[case]) or "robot" in case) == ("1 event" in agrees.stdout), agrees.stdout
    alter(tmp_path / LAW_FILES[1], r"(velocity\[1\]) = row\[VY\]", r"\1 = -row[VY]")
    assert check(tmp_path, ("cmac_leg.c", *LAW_FILES[1:])).returncode == 1


@pytest.mark.parametrize("override", LACKING)
def test_a_law_of_which_c_would_lack_a_part_is_refused_by_name(override, stored, tmp_path):
    keeps = ("record.weights=true", "record=metrics", "cycles=1", "learning.start_cycle=1")
    given = () if "kind" in override else (override,)
    done = call(
        "export", stored(*keeps, *LACKING[override], *given).folder, "--c", "--law", "--out", tmp_path / "out"
    )
    assert (done.returncode, done.stderr.startswith(f"error: {override}: must be ")) == (2, True), done.stderr
    assert not list(tmp_path.iterdir())


def test_replayed_along_the_plan_the_network_gives_the_torques_and_weights_of_the_run(stored):
    run = stored("record=trace", "record.weights=true", "cycles=2")
    network, trace = read_network(run, one_path=True), run.trace.iloc[-601:]
    learnt = network.params.weights.copy()
    network.params.weights[:] = 0.0
    feedback, feedforward = (
        trace[[f"tau_{name}_1", f"tau_{name}_2"]].to_numpy()[:, None] for name in ("feedback", "feedforward")
    )
    torque, weights = run_steps(network, network.inputs, feedback[:-1], np.float64)
    assert (torque == feedforward[1:]).all()
    assert (weights == learnt).all()


@pytest.mark.parametrize("override", ["learning.rule=zero_phase", "learning.lead=-3", "feedforward=ilc"])
def test_what_cannot_be_exported_is_refused_by_name(override, run_of, tmp_path):
    with pytest.raises(BadInput, match=override.partition("=")[0]):
        write_c(run_of(override), tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_the_command_writes_every_format_and_into_no_run(stored, tmp_path):
    run = shutil.copytree(stored("record=trace", "record.weights=true", "cycles=2").folder, tmp_path / "run")
    (tmp_path / "main.c").write_text("int main(void) { return 42; }")
    for words in (
        ["--out", "x"],
        ["--single"],
        ["--c", "--law", "--single"],
        ["--c", "--out", str(run)],
        ["--c", "--out", "."],
    ):
        done = python("-m", "cmacexp.export", str(run), *words, folder=tmp_path)
        assert (done.returncode, done.stderr.count("error: ")) == (2, 1), done.stderr
    done = python("-m", "cmacexp.export", "run", "--c", "--wide", "--mcap", folder=tmp_path)
    written = [f"export-run/{name}" for name in ("cmac_leg.h", "wide.parquet", "run.mcap")]
    assert (done.returncode, done.stdout.splitlines()) == (0, written), done.stderr
    assert all((tmp_path / name).stat().st_size for name in written)


def test_nothing_that_a_run_says_gets_into_the_code_or_runs(copy, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "evil.py").write_text("raise SystemExit('imported')")
    config = cmacexp.load(copy).config
    change_manifest(copy, config={**config, "scenario": '*/\n#error injected\n"'}, seed="*/ injected")
    write_c(cmacexp.load(copy), tmp_path / "out")
    assert not any("injected" in (tmp_path / "out" / name).read_text() for name in FILES)
    for group in ("plant", "sensors", "controller", "feedforward"):
        change_manifest(copy, config={**config, group: {**config[group], "_target_": "evil.Module"}})
        with pytest.raises(BadInput, match=group):
            write_c(cmacexp.load(copy), tmp_path / "out")
    assert "evil" not in sys.modules


@pytest.mark.parametrize("name", ["weights", "ranges"])
def test_weights_that_nobody_learnt_are_refused(name, copy, tmp_path):
    arrays = dict(np.load(copy / "weights.npz"))
    for wrong in (np.full_like(arrays[name], np.inf), arrays[name][:, :1]):
        np.savez_compressed(copy / "weights.npz", **{**arrays, name: wrong})
        accept(copy, "weights.npz")
        with pytest.raises(BadRun, match=r"weights\.npz"):
            write_c(cmacexp.load(copy), tmp_path / "out")
