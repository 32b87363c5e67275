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
