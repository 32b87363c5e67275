"""Reports of a run and of a sweep, from the command line: whole files, what they rest on, what they refuse."""

import json
import math
import re
import shutil
from dataclasses import replace

import pytest
from support.command import cmacexp, python
from support.manifests import change_manifest

from cmacexp.config.difference import flat
from cmacexp.data.stored_run import StoredRun
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.parts import Drawing, Folded, Table
from cmacexp.report.run_report import make_run_report
from cmacexp.report.run_summary import RunSummary, make_rows, read_summary, sort_folders
from cmacexp.report.run_tables import list_settings
from cmacexp.report.style import include_zero, logarithmic, new_figure, spans_decades
from cmacexp.report.sweep_report import find_swept, make_sweep_report


def run(folder, *overrides):
    cmacexp("record=trace", *overrides, f"hydra.run.dir={folder}", folder=folder.parent)
    return folder


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Two runs; the first has a page of its own, and so has the sweep."""
    folder = tmp_path_factory.mktemp("report") / "sweep"
    cmacexp("-m", "record=trace", "cmac.layers=2,10", "cycles=3", f"hydra.sweep.dir={folder}", folder=folder.parent)
    assert page(report(folder / "0")).endswith("sweep/0/report/report.html")
    return folder


@pytest.fixture(scope="module")
def printed(sweep):
    """What ``python -m cmacexp.report`` prints of the sweep."""
    done = report(sweep)
    assert page(done).endswith("sweep/report/report.html")
    assert done.stderr == "", "no progress where nobody watches"
    return done.stdout


@pytest.fixture(scope="module")
def leg(sweep):
    return sweep / "0"


def report(*arguments):
    return python("-m", "cmacexp.report", *map(str, arguments), folder=arguments[0].parent)


def page(done):
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


def text_of(folder):
    return (folder / "report" / "report.html").read_text()


def parts_of(content):
    """All parts of a report, folded ones too."""
    inside = [part for section in content.sections for part in section.parts]
    return inside + [inner for part in inside if isinstance(part, Folded) for inner in part.parts]


def names_of(content):
    """The names of its figures."""
    return {part.name for part in parts_of(content) if isinstance(part, Drawing)}


def titles_of(content):
    return [section.title for section in content.sections]


def test_a_run_gets_a_page_that_needs_nothing_else(leg):
    assert not re.search(r"""<(img|script|link|iframe)|(src|href)=["'](?!#)|url\((?!#)""", text_of(leg))
    assert text_of(leg).count('<svg class="panel"') == 9 + 4 + 2
    files = {path.name for path in (leg / "report" / "figures").iterdir()}
    assert files == {f"{name}.svg" for name in ("metrics", "tracking", "torques")}
    assert not list((leg / "report").rglob(".*.part"))
    assert "How it ended" not in text_of(leg)


def test_the_text_of_figures_is_text_and_captions_say_what_is_seen(leg):
    tracking = re.search(r'<figure id="tracking">.*?</figure>', text_of(leg), re.DOTALL)[0]
    assert not re.search(r"\n\s*\n|<!--", tracking), "a blank line ends HTML in Markdown"
    words = re.findall(r">([^<>]+)</text>", tracking)
    assert {"contact force", "force, N", "time in the cycle, s", "desired", "cycle 1", "cycle 2", "cycle 3"} <= set(
        words
    )
    assert re.search(r"Largest in cycle 1 and in cycle 3: contact force [\d.]+ and [\d.]+ N;", tracking)


def test_curves_come_before_the_folded_tables(leg):
    before, _, folded = text_of(leg).partition("<details>")
    assert before.count("<figure") == 3
    assert "machine.leg.length_1" in folded
    assert "machine.leg.length_1" not in before


def test_settings_that_are_not_the_default_come_first(leg):
    (section,) = [each for each in make_run_report(StoredRun(leg)).sections if each.title == "Settings"]
    changed, folded = section.parts
    assert [row[:4] for row in changed.rows] == [
        ["cmac.layers", "2", "32", ""],
        ["record.recording", "false", "true", ""],
        ["cycles", "3", "5", ""],
    ]
    (table,) = folded.parts
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["machine.leg.length_1"] == ["0.35", "m", "Hip to knee, l1."]


def test_settings_of_an_unknown_scenario_are_not_compared(leg, tmp_path):
    copy = shutil.copytree(leg, tmp_path / "leg")
    change_manifest(copy, config={**StoredRun(copy).config, "scenario": "mine"})
    text, _ = list_settings(StoredRun(copy)).parts
    assert "no scenario mine" in text


def test_its_manifest_lists_what_it_rests_on_and_a_changed_trace_is_noticed(leg, tmp_path):
    copy = shutil.copytree(leg, tmp_path / "leg")
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


def test_of_the_cycles_that_are_shown_the_last_is_the_strongest(leg):
    content = make_run_report(StoredRun(leg))
    assert "Cycles shown: 1, 2, 3." in content.summary
    (tracking,) = [part for part in parts_of(content) if getattr(part, "name", "") == "tracking"]
    widths = {line.get_label(): line.get_linewidth() for line in tracking.figure.axes[-1].lines}
    assert set(widths) == {"cycle 1", "cycle 2", "cycle 3"}
    assert widths["cycle 3"] > widths["cycle 2"]


def test_a_thinned_run_shows_the_cycles_that_its_trace_kept(tmp_path):
    thin = run(tmp_path / "thin", "cycles=3", "record.cycles=[2,3]", "record.every_nth_step=7")
    assert "Cycles shown: 2, 3." in make_run_report(StoredRun(thin)).summary


def test_a_page_cannot_go_where_a_file_stands(leg, tmp_path):
    (tmp_path / "taken").touch()
    done = report(leg, "--out", tmp_path / "taken" / "below")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "taken is a file" in done.stderr


def test_a_point_mass_has_forces_and_no_joints(tmp_path):
    content = make_run_report(StoredRun(run(tmp_path / "mass", "scenario=force_step")))
    metrics = {row[0] for part in parts_of(content) if isinstance(part, Table) for row in part.rows}
    assert "force error <i>e</i><sub>F</sub>" in metrics
    assert not any("x error" in name for name in metrics)


@pytest.fixture(scope="module")
def fallen(tmp_path_factory):
    return run(tmp_path_factory.mktemp("report") / "fell", "scenario=quadruped", "posture.gain=0", "cycles=2")


def test_a_quadruped_that_fell_says_why(fallen):
    content = make_run_report(StoredRun(fallen))
    assert "The run fell at step 147 (t = 0.735 s): the body has no static equilibrium" in content.summary
    assert {"end", "body", "force"} <= names_of(content)


def test_a_sweep_reports_what_was_swept(sweep, printed):
    rows = [line.split() for line in printed.splitlines()]
    assert [row[:3] for row in rows[4:6]] == [["0", "2", "completed"], ["1", "10", "completed"]]
    assert "What differs between them: cmac.layers." in text_of(sweep)
    names = {path.stem for path in (sweep / "report" / "figures").iterdir()}
    assert {"learning", "over-cmac-layers"} <= names


def test_two_swept_keys_have_a_figure_each_with_a_line_for_each_value_of_the_other(sweep):
    runs = [
        replace(run, config=run.config | {"learning.rate": rate}, status=status)
        for run in map(read_summary, (sweep / "0", sweep / "1"))
        for rate, status in ((0.1, "completed"), (0.2, "completed"), (1.8, "diverged"))
    ]
    content = make_sweep_report(runs, "sweep")
    assert (
        "6 runs: 4 completed, 2 diverged. What differs between them: cmac.layers, learning.rate." in content.summary
    )
    (over,) = [part.figure for part in parts_of(content) if getattr(part, "name", "") == "over-cmac-layers"]
    assert [text.get_text() for text in over.legends[0].get_texts()] == ["0.1", "0.2", "fell or diverged"]
    assert {"learning", "over-learning-rate"} <= names_of(content)


def test_a_broken_run_is_listed_and_in_no_figure(sweep, tmp_path):
    copy = shutil.copytree(sweep, tmp_path / "sweep", ignore=shutil.ignore_patterns("report"))
    (copy / "1" / "manifest.json").unlink()
    runs = [read_summary(copy / name) for name in "01"]
    content = make_sweep_report(runs, "sweep")
    assert content.summary == "2 runs: 1 completed, 1 unfinished.", "what differs is not known"
    assert not any("the same config" in part for part in parts_of(content) if isinstance(part, str))
    cells = [cell for part in parts_of(content) if isinstance(part, Table) for row in part.rows for cell in row]
    assert any("the run was killed before its end" in cell for cell in cells)
    assert copy / "0" / "trace.parquet" in content.inputs
    assert not [path for path in content.inputs if path.parent.name == "1"]


def test_a_report_is_no_run_to_the_other_commands(sweep, printed):
    assert printed.count("completed") == 2
    for command in ("score", "verify"):
        done = python("-m", f"cmacexp.{command}", str(sweep), folder=sweep.parent)
        assert done.returncode == 0, done.stderr
    assert done.stdout.count(": intact (completed)") == 5, "the sweep, two runs, a report of one and of both"


def test_final_and_best_are_of_whole_cycles(leg):
    summary = read_summary(leg)
    (row,) = make_rows([summary], ["cycles"])
    assert (row["run"], row["status"], row["cycles_done"]) == ("0", "completed", 3)
    errors = summary.metrics["force_rmse"]
    assert row["final_force_rmse"] == errors[2]
    assert row["best_force_rmse"] == min(errors)
    assert row["best_feedforward_share"] == max(summary.metrics["feedforward_share"])
    assert math.isnan(row["final_tilt_max"])


def test_a_cycle_that_the_run_did_not_end_is_no_final_one(fallen):
    summary = read_summary(fallen)
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


def test_axes_are_logarithmic_only_where_values_allow_it():
    assert spans_decades([1.0, 100.0, math.nan])
    assert spans_decades([0.0, 1.0, 100.0])
    assert not spans_decades([1.0, 15.0])
    assert not spans_decades([-1.0, 100.0])
    assert not spans_decades([math.nan])


def test_axes_do_not_exaggerate_differences():
    _, (errors, heights) = new_figure(1, 2)
    for axes in (errors, heights):
        axes.plot([0, 1], [1.42, 1.52])
    include_zero(errors, [1.42, 1.52])
    include_zero(heights, [1.42, 1.52], from_zero=False)
    assert errors.get_ylim()[0] <= 0.0
    assert heights.get_ylim()[0] > 1.0
    figure = draw([Panel("error", "cycle", "mm", [Series("a", [1, 2], [1.42, 1.52])])])
    assert figure.axes[0].get_ylim()[0] <= 0.0


@pytest.mark.parametrize("ends", [(6.0, 9.0), (0.5, 30.0), (1e-3, 1e3)])
def test_a_logarithmic_axis_has_several_plain_numbers(ends):
    figure, (axes,) = new_figure()
    axes.plot([0, 1], ends)
    logarithmic(axes, "y", ends)
    figure.draw_without_rendering()
    low, high = axes.get_ylim()
    major = [tick.label1.get_text() for tick in axes.yaxis.get_major_ticks() if low <= tick.get_loc() <= high]
    assert len(major) >= 3
    assert all(re.fullmatch(r"[\d.]+", text) for text in major)
    assert not any(tick.label1.get_text() for tick in axes.yaxis.get_minor_ticks())
