"""The examples run as printed and end with a number, all but the one that needs models of robots."""

import re

import pytest
from support.command import ROOT, python

EXAMPLES = [path for path in sorted((ROOT / "examples").glob("*.py")) if "machine=go2" not in path.read_text()]


@pytest.mark.ci
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_as_printed_and_ends_with_a_number(path, tmp_path):
    done = python(str(path), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\d", done.stdout.splitlines()[-1])
