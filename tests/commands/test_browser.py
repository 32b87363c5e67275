"""The page "Learn in the browser": its leg has the bits of Python's, and it is small."""

import json
import shutil
import subprocess

import browser
import numpy as np
import pytest
from support.rollout import roll_out

from benchmarks.c_loop import COLUMNS

pytestmark = pytest.mark.ci
RUN = """
require(process.argv[1] + "/leg.js");
require(process.argv[2]);
const settings = JSON.parse(process.argv[3]);
process.stderr.write(LegModel.overrides(settings, 30));
LegModel.load(cmacexpData).then((model) => model.leg(settings)).then((leg) => {
  for (let k = 0; k < 40; k++) require("fs").writeSync(1, Buffer.from(leg.take(300 + 300 * (k % 2)).buffer));
});
"""
"""Prints forty parts of a run, a cycle or half of one each, and as what Python runs it."""


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    module = browser.compile_leg() if shutil.which("node") else None
    if module is None:
        # Few computers have both, and nothing of the package needs them: they build and try a page of the site.
        pytest.skip("needs node, and clang with the linker of WebAssembly")
    script = tmp_path_factory.mktemp("page") / browser.DATA
    script.write_text(browser.make_data(module))
    return str(script)


@pytest.mark.parametrize(
    "settings",
    [
        {"stiffness": 10, "mass": 0.5, "delay": 0, "rate": 0.1953125, "lead": 1, "guard": False},
        {"stiffness": 20, "mass": 1.2, "delay": 2, "rate": 0.5, "lead": 3, "guard": True},
        {"stiffness": 10, "mass": 0.5, "delay": 2, "rate": 0.1, "lead": 0, "guard": True},  # frozen in cycle 10
        {"stiffness": 10, "mass": 0.5, "delay": 0, "rate": 0.5, "lead": 8, "guard": False},  # diverges in cycle 12
        {"stiffness": 50, "mass": 0.5, "delay": 2, "rate": 0.2, "lead": 3, "guard": True},  # feedback only chatters
    ],
)
def test_the_leg_of_the_page_gives_the_bits_of_python(data, settings):
    words = ["node", "-e", RUN, browser.DOCS, data, json.dumps(settings)]
    run = subprocess.run(words, check=True, capture_output=True)
    columns = roll_out(browser.make_scenario(browser.make_config(*run.stderr.decode().split()))).columns()
    assert run.stdout == np.column_stack([columns[name][:, 0] for name in COLUMNS]).tobytes()


def test_the_page_is_small(data):
    names = data, "browser.md", "browser.js", "browser.css", "leg.js"
    assert sum(browser.DOCS.joinpath(name).stat().st_size for name in names) < 400_000
