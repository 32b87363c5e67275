"""Runs for other programs: a wide table and MCAP, read back by other readers than this project's."""

import json
import shutil
import sys
import tracemalloc

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from support.command import python
from support.manifests import accept

from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadRun, CmacexpError
from cmacexp.experiment.api import run
from cmacexp.export.mcap import write_mcap
from cmacexp.export.wide import write_wide


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Runs of one leg, and of a walk whose force sensors are noisy and whose trace is thinned."""
    folder = tmp_path_factory.mktemp("runs")
    run(["scenario=one_leg", "cycles=2", "record=trace", "warn=false"], folder / "leg")
    thinned = ["scenario=quadruped", "cycles=1", "record=trace", "record.every_nth_step=3", "sensors=noisy_force"]
    run([*thinned, "warn=false"], folder / "walk")
    return folder


@pytest.fixture(params=["leg", "walk"])
def stored(request, folder):
    return StoredRun(folder / request.param)


def legs_of(stored):
    return {f"leg{number}": rows.reset_index(drop=True) for number, rows in stored.trace.groupby("leg")}


def test_a_wide_table_has_every_value_of_the_run_in_one_row_a_step(stored, tmp_path):
    path = write_wide(stored, tmp_path)
    table, columns = pq.read_table(path), pq.ParquetFile(path).metadata.row_group(0)
    assert table.column_names[0] == "time"
    assert table.schema.field("leg1.force").metadata[b"unit"] == b"N"
    encodings = {each for index in range(columns.num_columns) for each in columns.column(index).encodings}
    assert not {"PLAIN_DICTIONARY", "RLE_DICTIONARY"} & encodings  # which some readers do not know
    assert set(table.schema.types) <= {pa.float64(), pa.int32()}
    found = table.to_pandas()
    bodies = {"body": stored.body} if stored.walks else {}
    own = ["time", "step", "cycle"]
    for group, rows in {**legs_of(stored), **bodies}.items():
        assert (found[own] == rows[own]).all(axis=None)
        for name in set(rows) - {*own, "leg", "phase"}:
            np.testing.assert_array_equal(found[f"{group}.{name}"], rows[name])
    assert (found["leg1.support"] == (legs_of(stored)["leg1"]["phase"] == "support")).all()


def test_mcap_has_a_message_for_each_step_and_topic(stored, tmp_path):
    expected = legs_of(stored) | ({"body": stored.body} if stored.walks else {})
    found = {name: [] for name in expected}
    with write_mcap(stored, tmp_path).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            found[channel.topic[1:]].append((message.log_time, json.loads(message.data)))
            assert schema.encoding == "jsonschema"
        assert {entry.name for entry in reader.iter_metadata()} == {"cmacexp"}
        fields = {s.name: json.loads(s.data)["properties"] for s in reader.get_summary().schemas.values()}
    assert fields["cmacexp.leg1"]["force"]["unit"] == "N"
    for name, rows in expected.items():
        times, messages = zip(*found[name], strict=True)
        assert times == tuple(round(time * 1e9) for time in rows["time"])
        table = pd.DataFrame(messages)
        assert set(table) == set(fields[f"cmacexp.{name}"])
        for column in set(table) - {"support"}:
            np.testing.assert_array_equal(table[column].astype(float), rows[column].astype(float))


def test_what_is_not_finite_is_null_in_json(folder, tmp_path):
    walk = shutil.copytree(folder / "walk", tmp_path / "walk")
    body = pq.read_table(walk / "body.parquet")
    values = [float("inf"), float("-inf"), float("nan"), *body["height"].to_pylist()[3:]]
    pq.write_table(body.set_column(body.column_names.index("height"), "height", [values]), walk / "body.parquet")
    accept(walk, "body.parquet")
    with write_mcap(StoredRun(walk), tmp_path).open("rb") as file:
        read = [json.loads(message.data) for *_, message in make_reader(file).iter_messages(topics=["/body"])]
    assert [row["height"] for row in read[:4]] == [None, None, None, values[3]]


@pytest.mark.parametrize("write", [write_wide, write_mcap])
def test_a_damaged_run_leaves_no_file(write, folder, tmp_path):
    """A trace that is not its own, that has no step or other columns, and one without the last row of the body's."""
    walk, out = shutil.copytree(folder / "walk", tmp_path / "walk"), tmp_path / "out"
    trace = pq.read_table(walk / "trace.parquet")
    pq.write_table(trace.slice(1), walk / "trace.parquet")
    with pytest.raises(BadRun, match="changed since it was written"):
        write(StoredRun(walk), out)
    strange = trace.slice(0, 0), trace.drop_columns("time"), trace.append_column("a", [["b"] * len(trace)])
    cases = [(each, "holds no step of a run") for each in strange]
    for changed, said in [*cases, (trace.slice(0, len(trace) - 1), "have not the same steps")]:
        pq.write_table(changed, walk / "trace.parquet")
        accept(walk, "trace.parquet")
        with pytest.raises(BadRun, match=said):
            write(StoredRun(walk), out)
    assert not list(out.glob("*"))


def test_a_long_run_is_written_part_by_part(folder, tmp_path):
    """Ten times as many parts take no more memory, and as many row groups are written."""
    leg, peaks = shutil.copytree(folder / "leg", tmp_path / "leg"), []
    trace = pq.read_table(leg / "trace.parquet")
    for parts in (2, 20):
        with pq.ParquetWriter(leg / "trace.parquet", trace.schema) as writer:
            for _ in range(parts):
                writer.write_table(trace)
        accept(leg, "trace.parquet")
        held = pa.total_allocated_bytes()
        tracemalloc.start()
        path = write_wide(StoredRun(leg), tmp_path)
        peaks.append(tracemalloc.get_traced_memory()[1] + pa.total_allocated_bytes() - held)
        tracemalloc.stop()
        assert pq.ParquetFile(path).num_row_groups == parts
    assert peaks[1] < 2 * peaks[0]


def test_the_recipe_for_lerobot_gives_each_cycle_as_an_episode(folder, tmp_path):
    stored = StoredRun(folder / "leg")
    done = python("-m", "docs.lerobot_recipe", str(stored.folder), "set", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, f"2 episodes, {len(stored.trace)} frames\n"), done.stderr
    info = json.loads((tmp_path / "set" / "meta" / "info.json").read_text())
    data = pd.read_parquet(tmp_path / "set" / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(data) == set(info["features"])
    states = np.stack(data["observation.state"])
    names = [name.removeprefix("leg1.") for name in info["features"]["observation.state"]["names"]]
    np.testing.assert_array_equal(states, stored.trace[names].to_numpy(np.float32))
    episodes = pd.read_parquet(tmp_path / "set" / "meta" / "episodes")
    for row in episodes.itertuples():
        own = data.iloc[row.dataset_from_index : row.dataset_to_index]
        assert (len(own), set(own["episode_index"])) == (row.length, {row.episode_index})
    np.testing.assert_allclose(episodes["stats/action/max"][1], np.stack(own["action"]).max(axis=0))
    assert pd.read_parquet(tmp_path / "set" / "meta" / "tasks.parquet").index.name == "task"


def test_without_the_extra_one_line_says_what_to_install(folder, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap", None)
    with pytest.raises(CmacexpError, match=r"\[mcap\]"):
        write_mcap(StoredRun(folder / "leg"), tmp_path)
    assert not list(tmp_path.iterdir())
