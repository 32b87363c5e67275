"""Damage of a run is found by whatever reads it, in one line; nothing is read that the run did not write."""

import io
import json
import os
import random
import shutil
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.lib import format as npy
from support.command import call
from support.damage import BAD_TEXTS, flip
from support.doors import BadInput, CmacexpError, Report, compose_config, make_scenario, write_report
from support.manifests import accept, change_manifest

import cmacexp
from cmacexp.config import config_hash
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import faults
from cmacexp.data.manifest import everything_below, runs_below
from cmacexp.data.tables import (
    BODY_FILE,
    BODY_METRICS_FILE,
    MEMORY_FILE,
    METRICS_FILE,
    TRACE_FILE,
)
from cmacexp.data.trace import read_trace
from cmacexp.data.weights import WEIGHTS


@pytest.fixture
def walk(walk, tmp_path):
    """The folder of a walk that a test may change."""
    return shutil.copytree(walk.folder, tmp_path / "walk")


@pytest.fixture
def leg(leg, tmp_path):
    return shutil.copytree(leg.folder, tmp_path / "leg")


def use(*words) -> None:
    """A command in this process; raises what it prints if its exit code is not 0."""
    done = call(*words)
    if done.returncode:
        assert "Traceback" not in done.stderr
        assert len(done.stderr.splitlines()) <= 1
        raise CmacexpError(done.stdout + done.stderr.strip())


composed = cache(lambda: compose_config(["scenario=one_leg"]))


def start_from(folder: Path) -> None:
    """Prepare a run that starts from the weights in ``folder``."""
    config = composed()
    make_scenario(replace(config, learning=replace(config.learning, start_from=str(folder))))


READERS = {
    TRACE_FILE: (
        lambda folder: cmacexp.load(folder).trace,
        lambda folder: cmacexp.load(folder).read_trace([1]),
        lambda folder: use("score", folder),
        lambda folder: use("replay", folder, "--no-viewer", "--rebuild"),
    ),
    BODY_FILE: (lambda folder: cmacexp.load(folder).body, read_trace, lambda folder: use("score", folder)),
    MEMORY_FILE: (lambda folder: use("score", folder),),
    METRICS_FILE: (lambda folder: cmacexp.load(folder).metrics, lambda folder: cmacexp.load(folder).scores),
    BODY_METRICS_FILE: (lambda folder: cmacexp.load(folder).body_metrics, lambda folder: cmacexp.load(folder).scores),
    WEIGHTS: (start_from,),
}


@pytest.mark.parametrize("name", READERS)
def test_a_flipped_bit_of_a_file_is_found_by_all_that_read_it(name, request):
    folder = request.getfixturevalue("leg" if name == WEIGHTS else "walk")
    flip(folder / name, random.Random(name))
    assert [fault.split(":")[0] for fault in faults(folder)] == [name]
    for read in (*READERS[name], lambda folder: use("verify", folder)):
        with pytest.raises(CmacexpError, match=name):
            read(folder)


def test_a_flipped_bit_of_what_a_manifest_says_of_config_and_files_is_found(leg):
    path, chance = leg / manifests.MANIFEST, random.Random("manifest")
    text, config = path.read_text(), cmacexp.load(leg).config
    for _ in range(100):
        flip(path, chance)
        assert len(faults(leg)) == 1 or cmacexp.load(leg).config == config
        path.write_text(text)
    path.write_text(text.replace('"trace.parquet": "', '"trace.parquet": "0'))
    assert faults(leg)


def test_a_table_that_is_missing_or_that_the_run_did_not_write_is_not_read(leg, walk):
    shutil.copy(walk / BODY_FILE, leg / BODY_FILE)
    assert read_trace(leg).body is None
    with pytest.raises(CmacexpError, match=BODY_FILE):
        _ = cmacexp.load(leg).body
    (walk / BODY_FILE).unlink()
    for read in READERS[BODY_FILE]:
        with pytest.raises(CmacexpError, match=BODY_FILE):
            read(walk)


def test_views_are_none_of_what_is_verified(walk):
    for name in ("recording.rrd", "metrics.csv"):
        (walk / name).unlink()
        assert not faults(walk)
    change_manifest(walk, files={**manifests.read(walk)["files"], "recording.rrd": H, "metrics.csv": H})
    assert not faults(walk), "earlier versions list them"


H = "0" * 64
OTHER_CONFIG = "another config of the same hash"


def changed(manifest, *keys, value):
    """A manifest with another value at ``keys``."""
    first, *rest = keys
    return {**manifest, first: changed(manifest[first], *rest, value=value) if rest else value}


SHAPES = {
    "a list": lambda m: "[]",
    "a number": lambda m: "1",
    "deep": lambda m: "[" * 100_000,
    OTHER_CONFIG: lambda m: changed(m, "config", "seed", value=7),
    "large": lambda m: changed(m, "cause", value="x" * (17 << 20)),
    "a status of two lines": lambda m: changed(m, "status", value="failed)\nrun: intact (completed"),
    "files a list": lambda m: {**m, "files": list(m["files"])},
    "a hash is a number": lambda m: changed(m, "files", TRACE_FILE, value=3),
    "a file outside": lambda m: changed(m, "files", "../other", value=H),
    "an absolute file": lambda m: changed(m, "files", "/etc/passwd", value=H),
    "config of nothing": lambda m: {**m, "config": {}},
    "steps endless": lambda m: {**m, "steps": 10**400},
    "no steps": lambda m: {key: value for key, value in m.items() if key != "steps"},
    "memory of nothing": lambda m: {**m, "memory": [{"a": None}]},
    "drift of nothing": lambda m: {**m, "drift": {"a": 1}},
    "half a character": lambda m: {**m, "cause": "\ud800"},
    "a chain of a point": lambda m: {**m, "robot": {"chains": [[0.0]] * 4, "hips": [[0, 0]] * 4, "foot_radius": 0}},
    "runs a list": lambda m: {**m, "kind": "report", "runs": [1]},
    "a sweep without files": lambda m: {"kind": "sweep", "status": "completed", "config": {}},
    "a sweep with a file outside": lambda m: {**changed(m, "files", "../other", value=H), "kind": "sweep"},
}
USES = {
    "verify": lambda folder: use("verify", folder),
    "score": lambda folder: use("score", folder),
    "replay": lambda folder: use("replay", folder, "--no-viewer"),
    "load": lambda folder: cmacexp.load(folder).trace,
    "start_from": start_from,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_manifest_of_another_shape_is_refused_by_all_that_read_it(shape, leg):
    text = SHAPES[shape](manifests.read(leg))
    if isinstance(text, dict):
        other = {} if shape == OTHER_CONFIG else {"config_hash": config_hash(text["config"])}
        text = json.dumps({**text, **other})
    (leg / manifests.MANIFEST).write_text(text)
    for read in USES.values():
        with pytest.raises(CmacexpError):
            read(leg)


def set_column(table, name, values):
    return table.set_column(table.schema.get_field_index(name), name, values)


OTHER_TABLES = {
    "a column twice": lambda table: table.append_column("cycle", table["cycle"]),
    "texts": lambda table: set_column(table, "cycle", pa.array(["1"] * len(table))),
    "lists": lambda table: set_column(table, "cycle", pa.array([[1.0]] * len(table))),
    "nulls": lambda table: set_column(table, "leg", pa.nulls(len(table), pa.int32())),
    "a leg too many": lambda table: set_column(table, "leg", pa.array([2**31 - 1] * len(table), pa.int32())),
    "a row less": lambda table: table.slice(1),
}


@pytest.mark.parametrize("name", [TRACE_FILE, METRICS_FILE])
@pytest.mark.parametrize("form", OTHER_TABLES)
def test_a_table_of_another_form_is_refused_by_what_reads_it_whoever_wrote_it(name, form, leg):
    pq.write_table(OTHER_TABLES[form](pq.read_table(leg / name)), leg / name)
    accept(leg, name)
    read = {TRACE_FILE: lambda: use("score", leg), METRICS_FILE: lambda: cmacexp.load(leg).scores}[name]
    with pytest.raises(CmacexpError) as refused:
        read()
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("name", [manifests.MANIFEST, TRACE_FILE, WEIGHTS])
@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero"), Path.mkdir])
def test_only_regular_files_are_opened(name, make, leg):
    (leg / name).unlink()
    make(leg / name)
    assert len(faults(leg)) == 1
    for reader in {manifests.MANIFEST: USES, TRACE_FILE: ["verify", "load"], WEIGHTS: ["verify", "start_from"]}[name]:
        with pytest.raises(CmacexpError):
            USES[reader](leg)


def test_a_table_that_would_fill_the_memory_is_refused_before_it_is_read(leg, monkeypatch):
    """132 kB are enough for 400 MB; rows and pages are known from the end of the file."""
    zeros = pa.DictionaryArray.from_arrays(pa.array(np.zeros(10_000_000, np.int8)), pa.array([0]))
    pq.write_table(pa.table({name: zeros for name in ("step", "cycle", "leg")}), leg / TRACE_FILE)
    accept(leg, TRACE_FILE)
    assert (leg / TRACE_FILE).stat().st_size < 132_000
    monkeypatch.setattr(pq.ParquetFile, "read_row_group", None)
    with pytest.raises(CmacexpError, match="bytes that would become"):
        read_trace(leg)


def test_large_manifests_are_not_kept_in_memory(leg):
    manifest = manifests.read(leg)
    for size in (10, 100_000):
        change_manifest(leg, cause="x" * size)
        os.utime(leg / manifests.MANIFEST, (1, size))
        before = manifests._read_checked.cache_info().currsize
        assert len(manifests.read(leg)["cause"]) == size
        assert (manifests._read_checked.cache_info().currsize > before) == (size == 10)
    assert manifest["cause"] == ""


def test_texts_that_are_none_are_refused_in_one_line(leg):
    table = pq.read_table(leg / TRACE_FILE)
    words = pa.DictionaryArray.from_arrays(table["phase"].combine_chunks().indices, BAD_TEXTS)
    units = {"unit": b"\xff"}
    pq.write_table(set_column(table, "phase", words), leg / TRACE_FILE)
    accept(leg, TRACE_FILE)
    with pytest.raises(CmacexpError, match=TRACE_FILE):
        use("score", leg)
    fields = [field.with_metadata(units) for field in table.schema]
    pq.write_table(table.cast(pa.schema(fields)), leg / TRACE_FILE)
    accept(leg, TRACE_FILE)
    assert set(cmacexp.load(leg).units.values()) >= {"\N{REPLACEMENT CHARACTER}"}


@pytest.mark.parametrize(("shape", "kind"), [((10**11,), "<f8"), ((10,), "|O"), ((10,), "<f8")])
def test_weights_that_are_none_are_bad_input(shape, kind, leg):
    """The header says ``shape``; ten numbers follow."""
    header = io.BytesIO()
    npy.write_array_header_1_0(header, {"descr": kind, "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(leg / WEIGHTS, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("weights.npy", header.getvalue() + bytes(80))
    accept(leg, WEIGHTS)
    with pytest.raises(BadInput, match=r"learning\.start_from="):
        start_from(leg)


def test_a_report_inside_a_run_is_no_run(leg):
    write_report(Report("T", "S", []), leg / "report")
    assert runs_below(leg) == everything_below(leg) == [leg]
    assert [call("verify", leg).returncode, call("score", leg / "report").returncode] == [0, 2]


def test_links_to_folders_are_not_followed_but_the_folder_itself_may_be_one(leg, tmp_path):
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "loop").symlink_to(tmp_path)
    assert runs_below(tmp_path) == everything_below(tmp_path) == [leg]
    (tmp_path / "given").symlink_to(leg)
    assert runs_below(tmp_path / "given") == [tmp_path / "given"]


def test_what_is_printed_has_no_control_characters(leg, tmp_path):
    folder = leg.rename(tmp_path / "x\033[2K\033[1A\ny")
    done = [call(command, folder) for command in ("verify", "score")]
    assert [each.returncode for each in done] == [0, 0]
    flip(folder / METRICS_FILE, random.Random(0))  # a damaged run is printed too
    assert "\n" not in repr(cmacexp.load(folder))
    assert "\033" not in "".join(each.stdout + each.stderr for each in done) + repr(cmacexp.load(folder))
    assert len(done[0].stdout.splitlines()) == 1
