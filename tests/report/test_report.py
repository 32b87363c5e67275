"""Reports of a run and of several, from the command line: whole pages, what they rest on, what they refuse."""

import json
import re
import shutil

import pytest
from support.command import call
from support.made_studies import made_run

import cmacexp
from cmacexp.report.page import Drawing, Table
from cmacexp.report.run_figures import draw_metrics
from cmacexp.report.run_report import make_run_report
from cmacexp.report.sweep_report import make_sweep_report


@pytest.fixture(scope="module")
def content(leg):
    return make_run_report(leg)


@pytest.fixture(scope="module")
def fallen(stored):
    return stored("scenario=quadruped", "posture.gain=0", "cycles=2")


@pytest.fixture(scope="module")
def mass(stored):
    return stored("scenario=force_step")


def parts_of(content):
    """All parts of a report."""
    return [part for section in content.sections for part in section.parts]


def figures_of(content):
    """The figures of a report by their names."""
    return {part.name: part.figure for part in parts_of(content) if isinstance(part, Drawing)}


def cells_of(content):
    return [cell for part in parts_of(content) if isinstance(part, Table) for row in part.rows for cell in row]


@pytest.mark.ci
def test_a_run_gets_a_page_that_needs_nothing_else_and_names_its_run(leg, tmp_path):
    run = shutil.copytree(leg.folder, tmp_path / "leg")
    done = call("report", run)
    page = run / "report" / "report.html"
    assert (done.returncode, done.stdout.splitlines()[-1], done.stderr) == (0, str(page), "")
    text = page.read_text()
    assert not re.search(r"""<(img|script|link|iframe)|(src|href)=["'](?!#)|url\((?!#)""", text)
    figures = {f"figures/{path.name}" for path in (run / "report" / "figures").iterdir()}
    assert text.count("<figure") == len(figures) == 3
    assert not re.search(r"<figure((?!</figure>).)*\n\s*\n", text, re.DOTALL), "a blank line ends HTML in Markdown"
    manifest = json.loads((run / "report" / "manifest.json").read_text())
    assert manifest["config"]["runs"] == {str(run): leg.manifest["config_hash"]}
    with (run / "trace.parquet").open("ab") as file:
        file.write(b"x")
    assert call("report", run).returncode == 2


@pytest.mark.ci
def test_a_machine_without_joints_or_that_fell_has_the_figures_of_what_it_has(mass, fallen):
    assert "force error <i>e</i><sub>F</sub>" in cells_of(make_run_report(mass))
    content = make_run_report(fallen)
    assert fallen.manifest["cause"] in content.summary
    assert {"end", "body", "force"} <= figures_of(content).keys()


def test_figures_show_the_legs_and_what_is_pooled_of_them(walk):
    assert len(draw_metrics(walk).figure.axes[0].lines) == 5


def test_two_swept_keys_have_a_figure_each_with_a_line_for_each_value_of_the_other(leg):
    runs = [
        made_run(
            leg.folder,
            status,
            {name: rate * layers * values for name, values in leg.pooled.items()},
            **leg.settings | {"cmac.layers": layers, "learning.rate": rate},
        )
        for layers in (2, 10)
        for rate, status in ((0.1, "completed"), (0.2, "completed"), (1.8, "diverged"))
    ]
    figures = figures_of(make_sweep_report(runs, "sweep"))
    assert {"learning", "over-cmac-layers", "over-learning-rate"} <= figures.keys()
    legend = figures["over-cmac-layers"].legends[0]
    assert [text.get_text() for text in legend.get_texts()][:2] == ["0.1", "0.2"]


def test_a_run_that_was_killed_or_damaged_is_listed_and_in_no_figure(leg, tmp_path):
    folders = [shutil.copytree(leg.folder, tmp_path / name) for name in ("whole", "killed", "damaged")]
    (folders[1] / "manifest.json").unlink()
    (folders[2] / "trace.parquet").write_bytes(b"")
    content = make_sweep_report([cmacexp.Run(folder) for folder in folders], "sweep")
    assert {"killed", "damaged", "unfinished", "not intact"} <= {*cells_of(content)}
    (legend,) = [figure.legends for figure in figures_of(content).values()]
    assert not legend, "one run needs none"


@pytest.mark.ci
def test_the_page_of_several_runs_is_no_run(mass, tmp_path):
    runs = tmp_path / "runs"
    for name in ("2", "10"):
        shutil.copytree(mass.folder, runs / name)
    done = call("report", runs)
    assert done.returncode == 0, done.stderr
    rows = [line.split()[0] for line in done.stdout.splitlines() if "completed" in line]
    assert rows == ["2", "10"]
    assert [call(command, runs).returncode for command in ("score", "verify", "report")] == [0, 0, 0]
    assert len(cmacexp.load_sweep(runs)["run"].unique()) == 2
