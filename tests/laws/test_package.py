"""The package: what is said of it in several files agrees."""

import re
import subprocess
import tomllib
from pathlib import Path

import yaml

import cmacexp

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CI = (ROOT / ".ci" / "run").read_text()


def test_the_changelog_begins_with_this_version():
    assert "version" in PROJECT["dynamic"]
    headings = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert next(each for each in headings if each != "Unreleased") == cmacexp.__version__


def test_authors_and_licence_are_those_of_the_licence_wherever_they_stand():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["authors"] == PROJECT["authors"]
    assert citation["license"] == PROJECT["license"]
    licence = (ROOT / "LICENSE").read_text()
    assert licence.startswith(PROJECT["license"])
    assert citation["authors"][0]["name"] in licence


def test_every_version_of_python_that_the_package_allows_is_named_and_tested():
    first, limit = map(int, re.fullmatch(r">=3\.(\d+),<3\.(\d+)", PROJECT["requires-python"]).groups())
    allowed = [f"3.{minor}" for minor in range(first, limit)]
    named = [re.fullmatch(r"Programming Language :: Python :: ([\d.]+)", each) for each in PROJECT["classifiers"]]
    assert [match[1] for match in named if match] == allowed
    assert re.search(r"for version in (.*);", CI)[1].split() == allowed


def test_the_quick_part_of_the_tests_exists():
    line = re.search(r"^quick=\(.*\)", CI, re.MULTILINE)[0]
    command = ["bash", "-c", f'{line}; echo "${{quick[@]}}"']
    paths = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert paths
    assert all((ROOT / path).is_file() for path in paths)


def test_tools_see_that_the_package_is_typed():
    assert (Path(cmacexp.__file__).parent / "py.typed").is_file()
