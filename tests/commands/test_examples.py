"""The examples run as printed and end with a number; that of a real robot, which walks for a minute, at night."""

import re

import pytest
from support.command import ROOT, python
from support.robots import needs_models

EXAMPLES = [
    pytest.param(path, marks=[pytest.mark.nightly, needs_models] if path.stem == "07_go2" else pytest.mark.ci)
    for path in sorted((ROOT / "examples").glob("*.py"))
]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_as_printed_and_ends_with_a_number(path, tmp_path):
    done = python(str(path), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\d", done.stdout.splitlines()[-1])
