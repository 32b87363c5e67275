"""``python -m cmacexp.stability``: the page, the table, and what it cannot look at."""

import json

import pytest
from support.command import cmacexp, python

DIVERGING = ("learning.lead=-2", "cycles=45", "record=trace")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    assert cmacexp(*DIVERGING, "hydra.run.dir=run", folder=folder).returncode == 3
    return folder


def test_a_run_that_diverges_is_told_with_the_lead_that_holds(folder):
    done = python("-m", "cmacexp.stability", "run", folder=folder)
    assert done.returncode == 0, done.stderr
    assert "-2 (this run)" in done.stdout
    assert "Learning holds with lead 1." in done.stdout
    page = folder / "run" / "stability"
    assert done.stdout.splitlines()[-1] == str(page.relative_to(folder) / "report.html")
    manifest = json.loads((page / "manifest.json").read_text())
    assert "../trace.parquet" in manifest["files"]
    for name in ("growth", "mode", "real_parts"):
        assert (page / "figures" / f"{name}.png").is_file()
        assert (page / "figures" / f"{name}.svg").is_file()
    assert python("-m", "cmacexp.verify", "run", folder=folder).returncode == 0


@pytest.mark.parametrize(
    ("overrides", "why"),
    [
        (("feedforward=none", "cycles=12"), "nothing learns"),
        (("cycles=3",), "growth is measured over at least 6 cycles"),
        (("cycles=12", "record.every_nth_step=2"), "lacks steps"),
    ],
)
def test_what_cannot_be_told_is_said(tmp_path, overrides, why):
    assert cmacexp(*overrides, "record.recording=false", "hydra.run.dir=run", folder=tmp_path).returncode == 0
    done = python("-m", "cmacexp.stability", "run", folder=tmp_path)
    assert done.returncode == 2
    assert why in done.stderr
    assert len(done.stderr.splitlines()) == 1
