"""The C code of a network: it compiles without a warning, agrees bit for bit, and takes only numbers from a run."""

import re
import subprocess
import sys

import numpy as np
import pytest
from support.command import python
from support.manifests import accept, change_manifest
from support.robots import OWN

import cmacexp
from benchmarks.c_loop import compiler
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadInput, BadRun
from cmacexp.export.c_code import FILES, write_c
from cmacexp.export.network import read_network
from cmacexp.export.vectors import run_steps

FLAGS = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Werror"]
needs_compiler = pytest.mark.skipif(compiler() is None, reason="checks C code: needs a C compiler")
SHORT = ["record=metrics", "record.weights=true", "cycles=1", "learning.start_cycle=1"]
DENSE = ["cmac.addressing=dense", "cmac.inputs=[angle]", "cmac.displacement=odd_lattice"]
SMOOTH = ["cmac.receptive_field=cubic", "learning.rule=weight_smoothing", "cmac.displacement=parks_militzer"]
DECAYING = ["learning.rule=decaying_rate", "learning.decay=0.5"]
ROBOT = ["scenario=robot", "machine=mjcf", f"machine.path={OWN}", "cmac=phase", "learning.rule=leakage"]
CASES = {
    "hashed": ([], {}),
    "hashed single": ([], {"single": True}),
    "hashed path": ([], {"one_path": True}),
    "dense": ([*DENSE, "learning.rule=e_modification", "learning.lead=3"], {}),
    "smooth": ([*SMOOTH, "learning.lead=-1"], {}),
    "smooth single": ([*SMOOTH, "learning.lead=-1"], {"single": True}),
    "visited": (["cmac.addressing=visited", "cmac.receptive_field=linear", *DECAYING], {}),
    "quadruped": (["scenario=quadruped", "learning.rule=normalised", "learning.lead=1"], {"one_path": True}),
    "robot single": (ROBOT, {"single": True}),
    "rbf": (["feedforward=rbf", "learning.lead=-3"], {}),
    "model": (["feedforward=cmac_on_model", "learning.rule=dead_zone"], {}),
}


@pytest.fixture(scope="module")
def run_of(tmp_path_factory):
    """A short run with these overrides, made once."""
    runs = {}

    def make(*overrides):
        if "scenario=robot" in overrides:
            pytest.importorskip("mujoco")
        if overrides not in runs:
            runs[overrides] = cmacexp.run([*SHORT, *overrides], tmp_path_factory.mktemp("run")).folder
        return StoredRun(runs[overrides])

    return make


def check(folder):
    """Compile the C code without a warning; how its check ends."""
    command = [compiler(), *FLAGS, "-o", folder / "check", *(folder / name for name in FILES[1:])]
    compiled = subprocess.run(command, capture_output=True, text=True)
    assert compiled.returncode == 0, compiled.stderr
    return subprocess.run([folder / "check"], capture_output=True, text=True, timeout=60)


@needs_compiler
@pytest.mark.parametrize("case", CASES)
def test_c_computes_what_python_does(case, run_of, tmp_path):
    overrides, options = CASES[case]
    header = write_c(run_of(*overrides), tmp_path, **options).read_text()
    done = check(tmp_path)
    assert done.returncode == 0, done.stdout
    assert done.stdout.rstrip().endswith("state " + re.search(r"Memory: (\d+ bytes)", header)[1])
    assert ("SINGLE_ERROR" in header) == ("single" in case)


@needs_compiler
def test_a_changed_weight_and_a_changed_law_fail(run_of, tmp_path):
    write_c(run_of(), tmp_path)
    text = (source := tmp_path / "cmac_leg.c").read_text()
    for old, new in [
        (r"(learnt\[LEARNT\][^{]*\{\s*\{-?0x1\.)(.)", r"\g<1>8"),
        (r"rate \* error", "rate * error * error"),
    ]:
        changed = re.sub(old, new, text, count=1)
        assert changed != text
        source.write_text(changed)
        assert check(tmp_path).returncode == 1


def test_the_vectors_are_those_of_a_run(run_of):
    """Replayed along the plan, the network gives the torques that the loop recorded from the feedback that it had."""
    run = cmacexp.run(["record=trace", "record.weights=true", "cycles=2"], run_of().folder.parent / "traced")
    network = read_network(run, one_path=True)
    network.params.weights[:] = 0.0
    trace = run.trace.iloc[-601:]
    names = ("feedback", "feedforward")
    feedback, feedforward = (trace[[f"tau_{name}_1", f"tau_{name}_2"]].to_numpy()[:, None] for name in names)
    torque, weights = run_steps(network, network.inputs, feedback[:-1], np.float64)
    assert (torque == feedforward[1:]).all()
    assert (weights == read_network(run, one_path=True).params.weights).all()


@pytest.mark.parametrize("override", ["learning.rule=zero_phase", "learning.lead=-3", "feedforward=ilc"])
def test_what_cannot_be_exported_is_refused_by_name(override, run_of, tmp_path):
    with pytest.raises(BadInput, match=re.escape(override.replace("=ilc", "._target_=cmacexp.f"))):
        write_c(run_of(override), tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_the_command_writes_every_format_and_into_no_run(tmp_path):
    folder = cmacexp.run(
        [*DENSE, "record=trace", "record.weights=true", "cycles=1", "warn=false"], tmp_path / "run"
    ).folder
    for words in (["--out", "x"], ["--single"], ["--c", "--out", str(folder)]):
        done = python("-m", "cmacexp.export", str(folder), *words, folder=tmp_path)
        assert (done.returncode, done.stderr.count("error: ")) == (2, 1), done.stderr
    done = python("-m", "cmacexp.export", "run", "--c", "--wide", "--mcap", folder=tmp_path)
    written = [f"export-run/{name}" for name in ("cmac_leg.h", "wide.parquet", "run.mcap")]
    assert (done.returncode, done.stdout.splitlines()) == (0, written), done.stderr
    assert all((tmp_path / name).stat().st_size for name in written)


def test_nothing_that_a_run_says_gets_into_the_code_or_runs(run_of, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.py").write_text("raise SystemExit('imported')")
    folder = cmacexp.run([*SHORT, *DENSE], tmp_path / 'x */ #error injected "').folder
    config = StoredRun(folder).config
    change_manifest(folder, config={**config, "scenario": '*/\n#error injected\n"'}, seed="*/ injected")
    write_c(StoredRun(folder), tmp_path / "out")
    assert not any("injected" in (tmp_path / "out" / name).read_text() for name in FILES)
    for group in ("plant", "sensors", "controller", "feedforward"):
        change_manifest(folder, config={**config, group: {**config[group], "_target_": "evil.Module"}})
        with pytest.raises(BadInput, match=f"{group}._target_=evil.Module"):
            write_c(StoredRun(folder), tmp_path / "out")
    assert "evil" not in sys.modules


@pytest.mark.parametrize("name", ["weights", "ranges"])
def test_weights_that_nobody_learnt_are_refused(name, run_of, tmp_path):
    folder = cmacexp.run([*SHORT, *DENSE], tmp_path / "run").folder
    arrays = dict(np.load(folder / "weights.npz"))
    for wrong in (np.full_like(arrays[name], np.inf), arrays[name][:, :1]):
        np.savez_compressed(folder / "weights.npz", **{**arrays, name: wrong})
        accept(folder, "weights.npz")
        with pytest.raises(BadRun, match=r"weights\.npz"):
            write_c(StoredRun(folder), tmp_path / "out")
