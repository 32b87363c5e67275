"""Every command of the README runs as printed."""

import re

import pytest
from support.command import ROOT, cmacexp, python

README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


ELSEWHERE = ("python -m pipelines.paper --quick",)
"""Run by the tests of the studies."""


def commands() -> list[str]:
    return [line for block in blocks("bash") for line in block.splitlines() if line not in ELSEWHERE]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("readme")


@pytest.mark.parametrize("command", commands())
def test_command_runs_as_printed(command, folder):
    words = command.replace('"', "").split()
    assert words[0] == "python"
    if words[2] == "cmacexp.replay":
        words.append("--no-viewer")
    done = python(*words[1:], folder=folder)
    assert done.returncode == 0, done.stderr


def test_pandas_lines_run_on_the_run_above(folder):
    cmacexp("scenario=one_leg", "hydra.run.dir=outputs/first", folder=folder)
    (code,) = blocks("python")
    done = python("-c", code, folder=folder)
    assert done.returncode == 0, done.stderr
    assert "feedforward_share" in done.stdout


def test_notebook_lines_run(folder):
    (code,) = blocks("py")
    done = python("-c", code, folder=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("completed")


def test_table_is_what_the_command_prints(folder):
    done = cmacexp("scenario=one_leg", "record=trace", folder=folder)
    (table,) = blocks("text")
    printed = [line.rstrip() for line in done.stdout.splitlines()]
    assert [line.rstrip() for line in table.splitlines()] == printed[: len(table.splitlines())]
