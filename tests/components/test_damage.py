"""Damage of a run is found by whatever reads it, in one line; nothing is read that the run did not write."""

import json
import os
import random
import shutil
import sys
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support.manifests import change_manifest

import cmacexp
from cmacexp import replay, score, verify
from cmacexp.config.compose import compose_config
from cmacexp.data import hashes
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import everything_below, runs_below
from cmacexp.data.integrity import faults, is_finished
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY, BODY_METRICS, MEMORY, METRICS, METRICS_CSV, RECORDING, TRACE, read_traces
from cmacexp.data.weights import WEIGHTS, read_weights
from cmacexp.errors import CmacexpError
from cmacexp.report.page import Report, write_report
from cmacexp.report.run_summary import BROKEN, read_summary
from cmacexp.stability.analysis import analyse

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
        lambda folder: analyse(StoredRun(folder)),
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
    counted = hashes._once(lambda path: computed.append(path))
    path, later = leg / TRACE, time.time_ns() + 2 * hashes.RESOLUTION
    monkeypatch.setattr(time, "time_ns", lambda: later)
    counted(path)
    counted(path)
    assert computed == [path]
    os.utime(path)
    counted(path)
    assert computed == [path] * 2


def test_just_written_files_may_change_again_within_the_resolution_of_their_times(leg, monkeypatch):
    computed = []
    counted = hashes._once(lambda path: computed.append(path))
    monkeypatch.setattr(time, "time_ns", lambda: (leg / TRACE).stat().st_mtime_ns)
    counted(leg / TRACE)
    counted(leg / TRACE)
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
SHAPES = {
    "a list": lambda m: [m],
    "a number": lambda m: 1,
    "null": lambda m: None,
    "deep": lambda m: "DEEP",
    "files a list": lambda m: {**m, "files": list(m["files"])},
    "files empty": lambda m: {**m, "files": {}},
    "a hash is a number": lambda m: {**m, "files": {**m["files"], TRACE: 3}},
    "a file outside": lambda m: {**m, "files": {**m["files"], "../other": H}},
    "an absolute file": lambda m: {**m, "files": {**m["files"], "/etc/passwd": H}},
    "an endless name": lambda m: {**m, "files": {**m["files"], "x" * 5000: H}},
    "config text": lambda m: {**m, "config": "text"},
    "config without a gait": lambda m: {**m, "config": {**m["config"], "gait": None}},
    "record null": lambda m: {**m, "config": {**m["config"], "record": None}},
    "steps text": lambda m: {**m, "steps": "many"},
    "no steps": lambda m: {key: value for key, value in m.items() if key != "steps"},
    "memory of numbers": lambda m: {**m, "memory": [3]},
    "runs a list": lambda m: {**m, "runs": [1]},
    "an unknown entry": lambda m: {**m, "chechsum": H},
}
USES = {
    "verify": lambda folder: call(verify, folder),
    "score": lambda folder: call(score, folder),
    "replay": lambda folder: call(replay, folder, "--no-viewer"),
    "load": lambda folder: cmacexp.load(folder).trace,
    "start_from": lambda folder: read_weights(started(folder, *ONE_LEG)),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("earlier", [False, True], ids=["edited", "of an earlier version"])
def test_a_manifest_of_another_shape_is_one_line_everywhere(shape, earlier, leg, capsys):
    path = leg / manifests.NAME
    manifest = json.loads(path.read_text())
    if earlier:
        del manifest["checksum"]
    path.write_text("[" * 100_000 if shape == "deep" else json.dumps(SHAPES[shape](manifest), indent=2) + "\n")
    for name, use in USES.items():
        if (shape, name) == ("files empty", "load") or (shape, name, earlier) == ("an endless name", "load", True):
            continue
        if earlier and shape == "an endless name" and name != "verify":
            continue  # the files that these read are intact
        with pytest.raises(CmacexpError) as caught:
            use(leg)
        printed = capsys.readouterr()
        assert "\n" not in str(caught.value), name
        assert len(printed.err.splitlines()) <= 1, name
    assert not is_finished(leg, composed(*ONE_LEG))


def test_a_manifest_of_an_earlier_version_without_a_checksum_is_accepted(leg):
    manifest = json.loads((leg / manifests.NAME).read_text())
    for later in ("checksum", "memory", "dropped", "drift"):
        del manifest[later]
    (leg / manifests.NAME).write_text(json.dumps(manifest))
    assert not faults(leg)
    assert cmacexp.load(leg).manifest["memory"] == []
    score.score(leg)
    assert "checksum" in json.loads((leg / manifests.NAME).read_text())


def test_a_run_with_a_result_lists_its_tables(walk):
    change_manifest(walk, files={})
    missing = [TRACE, METRICS, METRICS_CSV, BODY, BODY_METRICS]
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


def test_links_to_folders_are_followed_once(leg, tmp_path):
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "first").symlink_to(leg)
    (tmp_path / "linked" / "loop").symlink_to(tmp_path / "linked")
    assert runs_below(tmp_path / "linked") == everything_below(tmp_path / "linked") == [tmp_path / "linked" / "first"]
    assert runs_below(tmp_path) == [leg], "the folder itself comes before a link to it"


def test_tables_are_read_through_one_function():
    package = Path(cmacexp.__file__).parent
    read = {path for path in package.rglob("*.py") if {"ParquetFile(", "read_table("} & set_of(path)}
    assert read == {package / "data" / "parquet.py"}


def set_of(path: Path) -> set[str]:
    """Which functions of pyarrow that read tables a file uses."""
    text = path.read_text()
    return {name for name in ("ParquetFile(", "read_table(") if f"pq.{name}" in text}
