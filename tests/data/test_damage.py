"""Damage of a run is found by whatever reads it, in one line; nothing is read that the run did not write."""

import io
import json
import os
import random
import shutil
import sys
import time
import zipfile
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path

import pytest
from numpy.lib import format as npy
from support.manifests import accept, change_manifest

import cmacexp
from cmacexp import replay, score, verify
from cmacexp.commands import report
from cmacexp.config import config_hash
from cmacexp.config.compose import compose_config
from cmacexp.data import hashes
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import everything_below, runs_below
from cmacexp.data.files import TIME_RESOLUTION
from cmacexp.data.integrity import faults, is_finished
from cmacexp.data.tables import BODY, BODY_METRICS, MEMORY, METRICS, METRICS_CSV, RECORDING, TRACE, read_traces
from cmacexp.data.weights import WEIGHTS, read_weights
from cmacexp.errors import BadInput, CmacexpError
from cmacexp.loop.scenario import make_scenario
from cmacexp.report.page import Report, write_report
from cmacexp.report.run_summary import BROKEN, read_summary

WALK = ["scenario=quadruped", "cycles=1", "sampling_period=0.02", "record.weights=true"]
ONE_LEG = ["scenario=one_leg", "cycles=1", "record=trace", "record.weights=true"]
FLIPS, FLIPS_OF_MANIFEST = 3, 300


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    return cmacexp.run(WALK, tmp_path_factory.mktemp("walk") / "run").folder


@pytest.fixture(scope="module")
def stood(tmp_path_factory):
    return cmacexp.run(ONE_LEG, tmp_path_factory.mktemp("leg") / "run").folder


@pytest.fixture
def walk(walked, tmp_path):
    return shutil.copytree(walked, tmp_path / "walk")


@pytest.fixture
def leg(stood, tmp_path):
    return shutil.copytree(stood, tmp_path / "leg")


def flip(path: Path, chance: random.Random) -> None:
    """Change one bit of a file."""
    data = bytearray(path.read_bytes())
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    path.write_bytes(data)


def call(module, *words: object) -> None:
    """A command in this process; raises what it prints if its exit code is not 0."""
    sys.argv = ["command", *map(str, words)]
    if code := module.main():
        raise CmacexpError(str(code))


@cache
def composed(*overrides: str):
    return compose_config(overrides)


def started(folder: Path, *overrides: str):
    """The config of a run that starts from the weights in ``folder``."""
    config = composed(*overrides)
    return replace(config, learning=replace(config.learning, start_from=str(folder)))


READERS = {
    TRACE: [
        lambda folder: cmacexp.load(folder).trace,
        lambda folder: cmacexp.load(folder).cycles([1]),
        lambda folder: score.score(folder),
        lambda folder: call(replay, folder, "--no-viewer", "--rebuild"),
    ],
    BODY: [lambda folder: cmacexp.load(folder).body, read_traces, lambda folder: score.score(folder)],
    MEMORY: [lambda folder: score.score(folder)],
    METRICS: [lambda folder: cmacexp.load(folder).metrics, lambda folder: cmacexp.load(folder).scores],
    BODY_METRICS: [lambda folder: cmacexp.load(folder).body_metrics, lambda folder: cmacexp.load(folder).scores],
    WEIGHTS: [lambda folder: read_weights(started(folder, *WALK))],
    METRICS_CSV: [],
}


@pytest.mark.parametrize("name", READERS)
def test_a_flipped_bit_of_a_file_is_found_by_all_that_read_it(name, walk, capsys):
    whole, chance = (walk / name).read_bytes(), random.Random(name)
    for _ in range(FLIPS):
        flip(walk / name, chance)
        assert faults(walk) == [f"{name}: changed since it was written"]
        for read in READERS[name]:
            with pytest.raises(CmacexpError) as caught:
                read(walk)
            assert f"{name}: changed since it was written" in str(caught.value) + capsys.readouterr().err
            assert "\n" not in str(caught.value)
        (walk / name).write_bytes(whole)
    assert not faults(walk)


def test_a_flipped_bit_of_a_manifest_is_found(leg):
    path, chance = leg / manifests.NAME, random.Random("manifest")
    whole = path.read_bytes()
    for _ in range(FLIPS_OF_MANIFEST):
        flip(path, chance)
        (fault,) = faults(leg)
        assert "\n" not in fault
        path.write_bytes(whole)
    assert not faults(leg)


def test_a_missing_table_of_the_body_is_not_taken_for_a_run_without_one(walk):
    (walk / BODY).unlink()
    for read in (read_traces, score.score):
        with pytest.raises(CmacexpError, match=r"body\.parquet: missing; run it again"):
            read(walk)


def test_a_file_that_the_run_did_not_write_is_not_read(leg, walk):
    shutil.copy(walk / BODY, leg / BODY)
    assert read_traces(leg).body is None
    with pytest.raises(CmacexpError, match=r"body\.parquet: the run did not write this file"):
        _ = cmacexp.load(leg).body


def test_a_damaged_recording_is_built_anew_with_a_word(walk, capsys):
    flip(walk / RECORDING, random.Random(0))
    call(replay, walk, "--no-viewer")
    assert f"{walk / RECORDING}: changed since it was written; it is built anew\n" in capsys.readouterr().err
    assert not faults(walk)


def test_a_hash_is_computed_once_while_a_file_does_not_change(leg, monkeypatch):
    computed = []
    monkeypatch.setattr(hashes, "sha256", computed.append)
    path, later = leg / TRACE, time.time_ns() + 2 * TIME_RESOLUTION
    monkeypatch.setattr(time, "time_ns", lambda: later)
    hashes.current_hash(path)
    hashes.current_hash(path)
    assert computed == [path]
    os.utime(path)
    hashes.current_hash(path)
    assert computed == [path] * 2


def test_just_written_files_may_change_again_within_the_resolution_of_their_times(leg, monkeypatch):
    computed = []
    monkeypatch.setattr(hashes, "sha256", computed.append)
    clock = count((leg / TRACE).stat().st_mtime_ns)
    monkeypatch.setattr(time, "time_ns", lambda: next(clock))
    hashes.current_hash(leg / TRACE)
    hashes.current_hash(leg / TRACE)
    assert len(computed) == 2


def test_printing_a_damaged_run_shows_one_line(leg):
    loaded = [cmacexp.load(leg) for _ in range(2)]
    flip(leg / METRICS, random.Random(0))
    said = f"{leg / METRICS}: changed since it was written; run it again"
    assert repr(loaded[0]) == f"Run({str(leg)!r}: {said})"
    assert said in loaded[0]._repr_html_()
    (leg / manifests.NAME).write_text("[]")
    assert "\n" not in repr(loaded[1])


def test_a_damaged_run_does_not_count_in_tables_and_is_not_finished(leg):
    config = composed(*ONE_LEG)
    assert is_finished(leg, config)
    flip(leg / TRACE, random.Random(0))
    assert read_summary(leg).status == BROKEN
    assert not is_finished(leg, config)


H = "0" * 64


def changed(manifest, *keys, value):
    """A manifest with another value at ``keys``."""
    first, *rest = keys
    return {**manifest, first: changed(manifest[first], *rest, value=value) if rest else value}


SHAPES = {
    "a list": lambda m: [m],
    "a number": lambda m: 1,
    "null": lambda m: None,
    "no checksum": lambda m: "NO CHECKSUM",
    "deep": lambda m: "DEEP",
    "nested": lambda m: changed(m, "config", "plant", value=json.loads("[" * 99 + "]" * 99)),
    "large": lambda m: changed(m, "cause", value="x" * (17 << 20)),
    "a status of two lines": lambda m: changed(m, "status", value="failed)\nrun: intact (completed"),
    "files a list": lambda m: {**m, "files": list(m["files"])},
    "a hash is a number": lambda m: changed(m, "files", TRACE, value=3),
    "a file outside": lambda m: changed(m, "files", "../other", value=H),
    "a file in a folder": lambda m: changed(m, "files", "report/other", value=H),
    "an absolute file": lambda m: changed(m, "files", "/etc/passwd", value=H),
    "config of nothing": lambda m: {**m, "config": {}},
    "config without a gait": lambda m: changed(m, "config", "gait", value=None),
    "no cycle": lambda m: changed(m, "config", "gait", "cycle_time", value=1e-9),
    "no period": lambda m: changed(m, "config", "sampling_period", value=0),
    "a period of nothing": lambda m: changed(m, "config", "sampling_period", value=1e-320),
    "a leg null": lambda m: changed(m, "config", "machine", "leg", value=None),
    "terrain null": lambda m: changed(m, "config", "terrain", value=None),
    "a class is a list": lambda m: changed(m, "config", "plant", "_target_", value=[1]),
    "record null": lambda m: changed(m, "config", "record", value=None),
    "steps text": lambda m: {**m, "steps": "many"},
    "steps endless": lambda m: {**m, "steps": 10**400},
    "no steps": lambda m: {key: value for key, value in m.items() if key != "steps"},
    "memory of numbers": lambda m: {**m, "memory": [3]},
    "memory of nothing": lambda m: {**m, "memory": [{"a": None}]},
    "drift of nothing": lambda m: {**m, "drift": {"a": 1}},
    "runs a list": lambda m: {**m, "kind": "report", "runs": [1]},
}
USES = {
    "verify": lambda folder: call(verify, folder),
    "score": lambda folder: call(score, folder),
    "replay": lambda folder: call(replay, folder, "--no-viewer"),
    "load": lambda folder: cmacexp.load(folder).trace,
    "start_from": lambda folder: read_weights(started(folder, *ONE_LEG)),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_manifest_of_another_shape_is_one_line_everywhere(shape, leg, capsys):
    path = leg / manifests.NAME
    manifest = SHAPES[shape](manifests.read(leg))
    if isinstance(manifest, dict):
        path.write_text(manifests.dump({**manifest, "config_hash": config_hash(manifest["config"])}))
    else:
        texts = {"DEEP": "[" * 100_000, "NO CHECKSUM": json.dumps(manifests.read(leg))}
        path.write_text(texts[manifest] if isinstance(manifest, str) else json.dumps(manifest))
    for name, use in USES.items():
        with pytest.raises(CmacexpError) as caught:
            use(leg)
        printed = capsys.readouterr()
        assert "\n" not in str(caught.value), name
        assert len(printed.err.splitlines()) <= 1, name
        assert len(printed.out.splitlines()) <= 2, name
    assert not is_finished(leg, composed(*ONE_LEG))


@pytest.mark.parametrize("name", [manifests.NAME, TRACE, WEIGHTS])
@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero"), Path.mkdir])
def test_only_regular_files_are_opened(name, make, leg, capsys):
    (leg / name).unlink()
    make(leg / name)
    (fault,) = faults(leg)
    assert fault.endswith("cannot be read (not a regular file)")
    for use in USES.values() if name == manifests.NAME else [USES["start_from" if name == WEIGHTS else "load"]]:
        with pytest.raises(CmacexpError):
            use(leg)
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("shape", "kind", "said"),
    [
        ((10**11,), "<f8", "weights.npz cannot be read"),
        ((10,), "|O", "weights.npz cannot be read"),
        ((10,), "<f8", r"do not fit this feedforward \(KeyError: 'ranges'\)"),
    ],
)
def test_weights_that_are_none_are_bad_input(shape, kind, said, leg):
    """The header says ``shape``; ten numbers follow."""
    header = io.BytesIO()
    npy.write_array_header_1_0(header, {"descr": kind, "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(leg / WEIGHTS, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("weights.npy", header.getvalue() + bytes(80))
    accept(leg, WEIGHTS)
    with pytest.raises(BadInput, match=rf"learning\.start_from=.*{said}"):
        make_scenario(started(leg, *ONE_LEG))


def test_a_run_starts_from_no_weights_that_a_report_or_a_sweep_lists(leg):
    manifest = {"kind": "sweep", "status": "completed", "config": {}, "versions": {}}
    text = manifests.dump({**manifest, "files": {WEIGHTS: hashes.current_hash(leg / WEIGHTS)}})
    (leg / manifests.NAME).write_text(text)
    with pytest.raises(BadInput) as caught:
        make_scenario(started(leg, *ONE_LEG))
    assert caught.value.key == "learning.start_from"


def test_what_is_printed_has_no_control_characters(leg, tmp_path, capsys):
    folder = leg.rename(tmp_path / "x\033[2K\033[1A\ny")
    call(verify, folder)
    call(score, folder)
    call(replay, folder, "--no-viewer", "--rebuild")
    call(report, folder)
    printed = capsys.readouterr()
    assert "\033" not in printed.out + printed.err + repr(cmacexp.load(folder))
    assert f"{tmp_path}/x\\x1b[2K\\x1b[1A\\ny: intact (completed)" in printed.out.splitlines()


def test_a_run_with_a_result_lists_its_tables(walk):
    change_manifest(walk, files={})
    missing = [METRICS, BODY_METRICS, METRICS_CSV, TRACE, BODY]
    assert faults(walk) == [f"{name}: not listed in manifest.json" for name in missing]
    change_manifest(walk, status="failed")
    assert not faults(walk), "a run that failed may have nothing"


def test_a_config_that_is_not_the_one_of_its_hash_is_found(leg):
    manifest = manifests.read(leg)
    manifests.write(leg, {**manifest, "config": {**manifest["config"], "seed": 7}})
    (fault,) = faults(leg)
    assert "its config is not the one of its config_hash" in fault


def test_verify_goes_on_after_a_file_that_cannot_be_read(leg, monkeypatch):
    def refuse(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(hashes, "current_hash", refuse)
    assert faults(leg) == [f"{name}: cannot be read (Permission denied)" for name in manifests.read(leg)["files"]]


def test_verify_finds_reports_inside_runs_and_their_files(leg, capsys):
    page = write_report(Report("T", "S", [], [leg / TRACE]), leg / "report")
    assert runs_below(leg) == [leg]
    assert everything_below(leg) == [leg, leg / "report"]
    with pytest.raises(CmacexpError, match="holds a report, not a run"):
        cmacexp.load(leg / "report")
    call(verify, leg)
    flip(page, random.Random(0))
    with pytest.raises(CmacexpError, match=str(verify.NOT_INTACT)):
        call(verify, leg)
    assert "report.html: changed since it was written" in capsys.readouterr().out


def test_links_to_folders_are_not_followed(leg, tmp_path):
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "loop").symlink_to(tmp_path)
    assert runs_below(tmp_path) == everything_below(tmp_path) == [leg]
    (tmp_path / "given").symlink_to(leg)
    assert runs_below(tmp_path / "given") == [tmp_path / "given"], "but the folder itself may be a link"
