"""Runs for other programs: a wide table and MCAP, read back by other readers than this project's."""

import json
import shutil

import lerobot_recipe
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from support.doors import CmacexpError
from support.manifests import accept
from support.pages import blocks

import cmacexp
from cmacexp.addons.export.tables import write_mcap, write_wide


@pytest.fixture(scope="module", params=["leg", "walk"])
def run(request):
    return request.getfixturevalue(request.param)


@pytest.fixture
def copy(walk, tmp_path):
    """A walk that a test may change."""
    return shutil.copytree(walk.folder, tmp_path / "walk")


def tables_of(run):
    """The rows of each leg and of the body."""
    legs = {f"leg{number}": rows.reset_index(drop=True) for number, rows in run.trace.groupby("leg")}
    return legs | ({"body": run.body} if run.walks else {})


def test_a_wide_table_has_every_value_of_the_run_in_one_row_a_step(run, tmp_path):
    table = pq.read_table(write_wide(run, tmp_path))
    assert table.column_names[0] == "time"
    assert table.schema.field("leg1.force").metadata[b"unit"] == b"N"
    assert set(table.schema.types) <= {pa.float64(), pa.int32()}
    found, own = table.to_pandas(), ["time", "step", "cycle"]
    for group, rows in tables_of(run).items():
        assert (found[own] == rows[own]).all(axis=None)
        for name in set(rows) - {*own, "leg", "phase"}:
            np.testing.assert_array_equal(found[f"{group}.{name}"], rows[name])
    assert (found["leg1.support"] == (tables_of(run)["leg1"]["phase"] == "support")).all()


def test_mcap_has_a_message_for_each_step_and_topic(run, tmp_path):
    found = {name: [] for name in tables_of(run)}
    with write_mcap(run, tmp_path).open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            found[channel.topic[1:]].append((message.log_time, json.loads(message.data)))
            assert schema.encoding == "jsonschema"
    for name, rows in tables_of(run).items():
        times, messages = zip(*found[name], strict=True)
        assert times == tuple(round(time * 1e9) for time in rows["time"])
        table = pd.DataFrame(messages)
        assert {*rows} - {*table} <= {"time", "leg", "phase"}
        for column in set(table) - {"support"}:
            np.testing.assert_array_equal(table[column].astype(float), rows[column].astype(float))


def test_what_is_not_finite_is_null_in_json(copy, tmp_path):
    body = pq.read_table(copy / "body.parquet")
    values = [float("inf"), float("-inf"), float("nan"), *body["height"].to_pylist()[3:]]
    pq.write_table(body.set_column(body.column_names.index("height"), "height", [values]), copy / "body.parquet")
    accept(copy, "body.parquet")
    with write_mcap(cmacexp.load(copy), tmp_path).open("rb") as file:
        read = [json.loads(message.data) for *_, message in make_reader(file).iter_messages(topics=["/body"])]
    assert [row["height"] for row in read[:4]] == [None, None, None, values[3]]


def test_a_file_of_somebody_else_is_not_replaced(copy, tmp_path):
    for write, name in ((write_wide, "wide.parquet"), (write_mcap, "run.mcap")):
        (tmp_path / name).write_text("mine")
        with pytest.raises(CmacexpError, match="not of this export"):
            write(cmacexp.load(copy), tmp_path)
        assert (tmp_path / name).read_text() == "mine"
        (tmp_path / name).unlink()
        assert [write(cmacexp.load(copy), tmp_path) for _ in range(2)] == [tmp_path / name] * 2


STRANGE = {
    "without steps": lambda trace: trace.slice(0, 0),
    "without a column": lambda trace: trace.drop_columns("time"),
    "with a column more": lambda trace: trace.append_column("a", [["b"] * len(trace)]),
    "without the last row of the body's": lambda trace: trace.slice(0, len(trace) - 1),
}


@pytest.mark.parametrize("change", STRANGE.values(), ids=STRANGE)
def test_a_damaged_run_leaves_no_file(change, copy, tmp_path):
    """Neither a trace that is not the run's own nor one that the manifest lists."""
    pq.write_table(change(pq.read_table(copy / "trace.parquet")), copy / "trace.parquet")
    for _ in range(2):
        for write in (write_wide, write_mcap):
            with pytest.raises(CmacexpError):
                write(cmacexp.load(copy), tmp_path / "out")
        accept(copy, "trace.parquet")
    assert not [*(tmp_path / "out").glob("*")]


@pytest.mark.ci
@pytest.mark.parametrize("reader", ["polars", "duckdb"])
def test_other_readers_give_the_same_figures_by_the_recipe_of_the_documentation(reader, walk, tmp_path, monkeypatch):
    pytest.importorskip(reader)
    (tmp_path / "outputs").mkdir()
    (tmp_path / "outputs" / "walk").symlink_to(walk.folder)
    monkeypatch.chdir(tmp_path)
    printed = []
    (block,) = (block for block in blocks("files.md") if block.code.startswith(f"import {reader}"))
    exec(block.code, {"print": printed.append})
    of_phase = walk.trace[walk.trace.phase == "transfer"]
    expected = ((of_phase.x - of_phase.x_desired) ** 2).groupby([of_phase.cycle, of_phase.leg]).mean() ** 0.5
    rows = printed[0].rows() if reader == "polars" else printed[0].fetchall()
    assert [row[:2] for row in rows] == expected.index.to_list()
    assert [row[2] for row in rows] == pytest.approx(expected.to_list())
    if reader == "duckdb":
        assert len(printed[1].fetchall()) == walk.metrics.force_overshoot.notna().sum()


@pytest.mark.ci
@pytest.mark.parametrize("name", ["trace", "body", "metrics", "body_metrics", "memory", "wide"])
def test_polars_and_duckdb_read_all_numbers_and_count_every_nan(name, walk, tmp_path):
    polars = pytest.importorskip("polars")
    duckdb = pytest.importorskip("duckdb")
    path = write_wide(walk, tmp_path) if name == "wide" else walk.folder / f"{name}.parquet"
    numbers = pd.read_parquet(path).select_dtypes("number")
    frame = polars.read_parquet(path)
    for column, values in numbers.items():
        query = f"""SELECT count("{column}"), sum("{column}") FROM '{path}' WHERE isfinite("{column}")"""
        count, total = duckdb.sql(query).fetchall()[0]
        finite = frame[column].cast(polars.Float64).fill_nan(None)
        assert count == len(finite) - finite.null_count() == values.count()
        assert (total or 0.0, finite.sum()) == pytest.approx((values.sum(), values.sum()))


@pytest.mark.ci
def test_the_recipe_for_lerobot_gives_each_cycle_as_an_episode(leg, tmp_path):
    out = tmp_path / "set"
    lerobot_recipe.export(leg.folder, out)
    info = json.loads((out / "meta" / "info.json").read_text())
    data = pd.read_parquet(out / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(data) == set(info["features"])
    names = [name.removeprefix("leg1.") for name in info["features"]["observation.state"]["names"]]
    np.testing.assert_array_equal(np.stack(data["observation.state"]), leg.trace[names].to_numpy(np.float32))
    assert data.groupby("episode_index").size().tolist() == [600] * 3
    assert pd.read_parquet(out / "meta" / "episodes")["length"].tolist() == [600] * 3
