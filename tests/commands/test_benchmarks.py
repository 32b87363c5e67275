"""The benchmarks run."""

import pytest
from support.command import ROOT, python


@pytest.mark.nightly
def test_a_benchmark_runs_from_the_command_line_and_keeps_its_tables(tmp_path):
    page = tmp_path / "page.md"
    done = python("-m", "benchmarks", "cmac", "--quick", "--write", str(page), folder=ROOT)
    assert done.returncode == 0, done.stderr
    assert any(line.startswith("|") for line in page.read_text().splitlines())
