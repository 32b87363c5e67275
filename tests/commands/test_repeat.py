"""``verify --repeat``: a run comes out the same from its manifest, or what is not the same is named."""

import shutil
import sys

import pytest
from support.manifests import change_manifest

import cmacexp
from cmacexp import verify
from cmacexp.data import manifest as manifests
from cmacexp.data.tables import METRICS, METRICS_CSV, RECORDING, TRACE
from cmacexp.data.weights import WEIGHTS

RUN = ["scenario=one_leg", "cycles=1", "gait.cycle_time=1.5", "learning.start_cycle=1"]
OWN = "from cmacexp.control import HybridController\n\nclass Own(HybridController):\n    pass\n"


@pytest.fixture(scope="module")
def learnt(tmp_path_factory):
    return cmacexp.run([*RUN, "record.weights=true"], tmp_path_factory.mktemp("repeat") / "run").folder


@pytest.fixture
def run(learnt, tmp_path):
    return shutil.copytree(learnt, tmp_path / "run")


@pytest.fixture
def repeat(capsys):
    """``repeat(folder)`` gives the exit code, the lines of the output, and what is on stderr."""

    def call(folder, *options):
        sys.argv = ["verify", "--repeat", str(folder), *map(str, options)]
        code = verify.main()
        printed = capsys.readouterr()
        return code, printed.out.splitlines(), printed.err

    return call


def test_a_run_comes_out_the_same_and_is_kept_where_asked(run, repeat, tmp_path):
    code, lines, _ = repeat(run, "--out", tmp_path / "again")
    assert code == 0
    assert lines[0] == f"{run}: repeated, EQUAL"
    for name in (TRACE, METRICS, METRICS_CSV, WEIGHTS):
        assert f"  {name}: equal" in lines
        assert (run / name).read_bytes() == (tmp_path / "again" / name).read_bytes()
    assert f"  {RECORDING}: not compared: it holds the time at which it was written" in lines
    assert len(lines) == 1 + len(manifests.read(run)["files"])


def test_other_bytes_are_named_with_what_may_explain_them(run, repeat):
    then = manifests.read(run)
    files = {**then["files"], TRACE: "0" * 64}
    change_manifest(run, files=files, versions={**then["versions"], "numpy": "1.0"}, code_hash="0" * 16, steps=7)
    code, lines, _ = repeat(run)
    assert code == verify.NOT_INTACT
    assert lines[0] == f"{run}: repeated, NOT EQUAL"
    assert f"  {TRACE}: differs" in lines
    assert f"  {METRICS}: equal" in lines
    assert f"  numpy: 1.0 then, {then['versions']['numpy']} now" in lines
    assert f"  code_hash: {'0' * 16} then, {then['code_hash']} now" in lines
    assert f"  steps: 7 then, {then['steps']} now" in lines


def test_a_run_that_ended_otherwise_is_not_equal(run, repeat):
    change_manifest(run, status="diverged", cause="at step 3")
    code, lines, _ = repeat(run)
    assert (code, lines[0]) == (verify.NOT_INTACT, f"{run}: repeated, NOT EQUAL")
    assert "  status: diverged then, completed now" in lines


def test_a_file_that_changed_since_is_not_equal_though_the_run_repeats(run, repeat):
    (run / METRICS).write_bytes(b"other")
    code, lines, _ = repeat(run)
    assert code == verify.NOT_INTACT
    assert f"  {METRICS}: equal to what the run wrote, but {run / METRICS} is changed since it was written" in lines


def test_a_run_repeats_from_the_weights_that_it_started_from_alone(run, repeat, tmp_path):
    later = cmacexp.run([*RUN, "record=trace", f"learning.start_from={run}"], tmp_path / "later").folder
    assert repeat(later)[0] == 0
    (run / WEIGHTS).write_bytes(b"other")
    code, lines, said = repeat(later)
    assert (code, lines) == (2, [])
    assert said.startswith(f"error: learning.start_from={run}: ")


def test_a_custom_component_has_to_be_importable(repeat, tmp_path, monkeypatch):
    (tmp_path / "own_controller.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    folder = cmacexp.run([*RUN, "record=trace", "controller._target_=own_controller.Own"], tmp_path / "own").folder
    assert repeat(folder)[0] == 0
    (tmp_path / "own_controller.py").unlink()
    monkeypatch.delitem(sys.modules, "own_controller")
    code, lines, said = repeat(folder)
    assert (code, lines) == (2, [])
    assert "there is no module own_controller" in said
    assert said.count("\n") == 1


def test_a_run_without_a_result_is_not_repeated(run, repeat):
    change_manifest(run, status="failed", files={}, steps=0, config={})
    code, lines, said = repeat(run)
    assert (code, lines) == (2, [])
    assert said.startswith(f"error: {run}: failed")
