"""Reports of a run and of a sweep, from the command line: whole files, what they rest on, what they refuse."""

import itertools
import json
import math
import shutil
from html.parser import HTMLParser

import pytest
from support.command import cmacexp, python

from cmacexp.config.difference import flat
from cmacexp.metrics.summary import shorten
from cmacexp.report.comparison import make_rows
from cmacexp.report.figure_data import mark, spans_decades
from cmacexp.report.run_summary import RunSummary, read_summary, sort_folders
from cmacexp.report.swept import find_swept


def run(folder, *overrides):
    cmacexp("record=trace", *overrides, f"hydra.run.dir={folder}", folder=folder.parent)
    return folder


@pytest.fixture(scope="module")
def leg(tmp_path_factory):
    return run(tmp_path_factory.mktemp("report") / "leg", "cycles=3")


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report") / "sweep"
    swept = ["learning.rate=0.1,0.2", "cmac.layers=2,10,16", "cycles=2"]
    cmacexp("-m", "record=trace", *swept, f"hydra.sweep.dir={folder}", folder=folder.parent)
    return folder


def report(*arguments):
    return python("-m", "cmacexp.report", *map(str, arguments), folder=arguments[0].parent)


def page(done):
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


class Sources(HTMLParser):
    """Where a page takes its pictures, scripts and styles from."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found += [
            dict(attrs).get("src") or dict(attrs).get("href") for _ in [0] if tag in ("img", "script", "link")
        ]


def text_of(folder):
    return (folder / "report" / "report.html").read_text()


@pytest.fixture(scope="module")
def reported(leg):
    """The run with its report."""
    assert page(report(leg)).endswith("leg/report/report.html")
    return leg


def test_a_run_gets_a_page_that_needs_nothing_else(reported):
    sources = Sources(text_of(reported)).found
    assert len(sources) >= 3
    assert all(source.startswith("data:image/svg+xml;base64,") for source in sources)
    names = {path.stem for path in (reported / "report" / "figures").iterdir()}
    assert {"metrics", "tracking", "torques"} <= names
    assert not list((reported / "report").rglob(".*.part"))
    assert "Memory of the feedforward" in text_of(reported)
    assert "How it ended" not in text_of(reported)


def test_its_manifest_lists_what_it_rests_on_and_a_changed_trace_is_noticed(reported, tmp_path):
    copy = shutil.copytree(reported, tmp_path / "leg")
    manifest = json.loads((copy / "report" / "manifest.json").read_text())
    assert {"../trace.parquet", "../metrics.parquet", "report.html", "figures/tracking.svg"} <= set(manifest["files"])
    verify = ["-m", "cmacexp.verify", str(copy / "report")]
    assert python(*verify, folder=tmp_path).returncode == 0
    with (copy / "trace.parquet").open("ab") as file:
        file.write(b"x")
    done = python(*verify, folder=tmp_path)
    assert done.returncode == 4
    assert "../trace.parquet: changed since it was written" in done.stdout
    refused = report(copy)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "trace.parquet: changed since it was written" in refused.stderr


def test_cycles_are_those_asked_for(leg, tmp_path):
    page(report(leg, "--cycles", "1,3", "--out", tmp_path / "out"))
    text = (tmp_path / "out" / "report.html").read_text()
    assert "Cycles shown: 1, 3." in text
    assert "cycle 3" in text
    assert "cycle 2" not in text


@pytest.mark.parametrize(
    ("cycles", "told"),
    [
        ("4", "--cycles=4: "),
        ("0", "has cycles 1 to 3"),
        ("one", "--cycles=one: must be whole numbers"),
        ("1,2,3,4,5,6,7", "at most 6"),
    ],
)
def test_cycles_that_cannot_be_shown_are_refused_in_one_line(leg, tmp_path, cycles, told):
    done = report(leg, "--cycles", cycles, "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_thinned_run_shows_the_cycles_that_its_trace_kept(tmp_path):
    thin = run(tmp_path / "thin", "cycles=5", "record.cycles=[2,4]", "record.every_nth_step=7")
    assert "Cycles shown: 2, 4." in (page(report(thin)) and text_of(thin))
    done = report(thin, "--cycles", "2,3")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: --cycles=3: is not in the trace, which holds only the cycles of record.cycles\n"


def test_a_page_cannot_go_where_a_file_stands(leg, tmp_path):
    (tmp_path / "taken").touch()
    done = report(leg, "--out", tmp_path / "taken" / "below")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "taken is a file" in done.stderr


def test_folders_that_hold_no_whole_run_are_refused(leg, tmp_path):
    (tmp_path / "empty").mkdir()
    untraced = shutil.copytree(leg, tmp_path / "untraced")
    (untraced / "trace.parquet").unlink()
    for folder, told in (
        (tmp_path / "nowhere", "no such folder"),
        (tmp_path / "empty", "contains no run"),
        (untraced, "trace.parquet: missing"),
    ):
        done = report(folder)
        assert done.returncode == 2
        assert told in done.stderr
        assert len(done.stderr.splitlines()) == 1


def test_a_point_mass_has_forces_and_no_joints(tmp_path):
    folder = run(tmp_path / "mass", "scenario=force_step")
    page(report(folder))
    assert "Memory of the feedforward" not in text_of(folder)
    assert "transfer_rmse_x" not in text_of(folder)
    assert "force_rmse" in text_of(folder)


def test_a_quadruped_that_fell_says_why(tmp_path):
    folder = run(tmp_path / "fell", "scenario=quadruped", "posture.gain=0", "cycles=2")
    page(report(folder))
    text = text_of(folder)
    assert "The run fell at step 147 (t = 0.735 s): the body has no static equilibrium" in text
    assert {"end", "body", "force"} <= {path.stem for path in (folder / "report" / "figures").iterdir()}
    assert "right rear" in text


def test_a_sweep_is_told_by_what_was_swept_and_broken_runs_are_listed(sweep, tmp_path):
    copy = shutil.copytree(sweep, tmp_path / "sweep", ignore=shutil.ignore_patterns("report"))
    (copy / "4" / "manifest.json").unlink()
    done = report(copy)
    assert page(done).endswith("sweep/report/report.html")
    rows = [line.split() for line in done.stdout.splitlines()]
    assert [row[:4] for row in rows[3:7]] == [
        ["0", "2", "0.1", "completed"],
        ["1", "10", "0.1", "completed"],
        ["2", "16", "0.1", "completed"],
        ["3", "2", "0.2", "completed"],
    ]
    text = text_of(copy)
    assert "What differs between them: cmac.layers, learning.rate." in text
    assert "the run was killed before its end" in text
    names = {path.stem for path in (copy / "report" / "figures").iterdir()}
    assert {"learning", "over-cmac-layers", "over-learning-rate", "side-by-side"} <= names
    inputs = json.loads((copy / "report" / "manifest.json").read_text())["files"]
    assert "../0/trace.parquet" in inputs
    assert not any(name.startswith("../4/") for name in inputs)


def test_a_report_is_no_run_to_the_other_commands(sweep):
    page(report(sweep / "0"))
    done = report(sweep)
    assert page(done)
    assert done.stdout.count("completed") == 6
    for command in ("score", "verify"):
        done = python("-m", f"cmacexp.{command}", str(sweep), folder=sweep.parent)
        assert done.returncode == 0, done.stderr
    assert done.stdout.count(": intact (completed)") == 8


def test_final_and_best_are_of_whole_cycles(leg):
    summary = read_summary(leg)
    (row,) = make_rows([summary], ["cycles"])
    assert (row["run"], row["status"], row["cycles_done"]) == ("leg", "completed", 3)
    errors = summary.metrics["force_rmse"]
    assert row["final_force_rmse"] == errors[2]
    assert row["best_force_rmse"] == min(errors)
    assert row["best_feedforward_share"] == max(summary.metrics["feedforward_share"])
    assert math.isnan(row["final_tilt_max"])


def test_a_cycle_that_the_run_did_not_end_is_no_final_one(tmp_path):
    summary = read_summary(run(tmp_path / "fell", "scenario=quadruped", "posture.gain=0"))
    assert (summary.status, summary.cycles) == ("fell", 0)
    assert math.isnan(summary.final("force_rmse"))


def summaries(tmp_path, *configs):
    return [RunSummary(tmp_path / str(i), "completed", "", flat(config)) for i, config in enumerate(configs)]


def test_keys_that_differ_between_the_same_runs_are_one(tmp_path):
    a = {
        "scenario": "s",
        "seed": 1,
        "machine": {"leg": {"mass": 1}, "legs": {"left": {"mass": 1}}},
        "record": {"r": 1},
    }
    b = {
        "scenario": "s",
        "seed": 2,
        "machine": {"leg": {"mass": 2}, "legs": {"left": {"mass": 2}}},
        "record": {"r": 2},
    }
    c = {**b, "seed": 3}
    swept = find_swept(summaries(tmp_path, a, b, c))
    assert swept.keys == ["machine.leg.mass"]
    assert swept.linked == {"machine.leg.mass": ["machine.legs.left.mass"]}
    assert swept.seeds == ["seed"]
    assert find_swept(summaries(tmp_path, b, c)).keys == ["seed"]
    assert find_swept(summaries(tmp_path, a, a)).keys == []


def test_what_the_scenario_decides_goes_with_it(tmp_path):
    configs = [
        {"scenario": s, "knee": k, "rate": r} for s, k, r in (("a", 1, 1), ("b", 0, 1), ("c", 0, 1), ("c", 0, 2))
    ]
    swept = find_swept(summaries(tmp_path, *configs))
    assert swept.keys == ["scenario", "rate"]
    assert swept.linked == {"scenario": ["knee"]}


def test_jobs_come_in_the_order_of_their_numbers(tmp_path):
    folders = [tmp_path / name for name in ("10", "2", "a", "1")]
    assert [path.name for path in sort_folders(folders)] == ["1", "2", "10", "a"]


def test_a_long_table_keeps_its_ends_and_evenly_spaced_rows_between():
    rows = [[str(i), ""] for i in range(1000)]
    short = shorten(rows)
    assert (short[:6], short[-6:]) == (rows[:6], rows[-6:])
    assert short == sorted(short, key=rows.index)
    gaps = {rows.index(later) - rows.index(row) for row, later in itertools.pairwise(short[5:-5])}
    assert max(gaps) - min(gaps) <= 1
    assert shorten(rows[:24]) == rows[:24]


def test_axes_are_logarithmic_only_where_values_allow_it():
    assert spans_decades([1.0, 100.0, math.nan])
    assert spans_decades([0.0, 1.0, 100.0])
    assert not spans_decades([1.0, 15.0])
    assert not spans_decades([-1.0, 100.0])
    assert not spans_decades([math.nan])


def test_lines_of_one_figure_differ_in_colour_or_dash():
    marks = {tuple(map(str, mark(index).values())) for index in range(12)}
    assert len(marks) == 12
