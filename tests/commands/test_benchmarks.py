"""The benchmarks run."""

import pytest
from support.command import ROOT, python


@pytest.mark.nightly
def test_a_benchmark_runs_from_the_command_line_and_fills_its_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- results: begin -->\nold\n<!-- results: end -->\nafter\n")
    done = python("-m", "benchmarks", "cmac", "--quick", "--write", str(page), folder=ROOT)
    assert done.returncode == 0, done.stderr
    begin, *results, end, after = page.read_text().splitlines()[1:]
    assert (begin, end, after) == ("<!-- results: begin -->", "<!-- results: end -->", "after")
    assert any(line.startswith("|") for line in results)
