"""Every command of the README runs as printed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def commands() -> list[str]:
    return [line for block in blocks("bash") for line in block.splitlines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("readme")


def execute(arguments: list[str], folder: Path) -> subprocess.CompletedProcess:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True)


@pytest.mark.parametrize("command", commands())
def test_command_runs_as_printed(command, folder):
    words = command.replace('"', "").split()
    assert words[0] == "python"
    if words[2] == "cmacexp.replay":
        words.append("--no-viewer")
    done = execute(words[1:], folder)
    assert done.returncode == 0, done.stderr


def test_pandas_lines_run_on_the_run_above(folder):
    execute(["-m", "cmacexp", "scenario=one_leg", "hydra.run.dir=outputs/first"], folder)
    (code,) = blocks("python")
    done = execute(["-c", code], folder)
    assert done.returncode == 0, done.stderr
    assert "feedforward_share" in done.stdout


def test_notebook_lines_run(folder):
    (code,) = blocks("py")
    done = execute(["-c", code], folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("completed")


def test_table_is_what_the_command_prints(folder):
    done = execute(["-m", "cmacexp", "scenario=one_leg", "record=trace"], folder)
    (table,) = blocks("text")
    printed = [line.rstrip() for line in done.stdout.splitlines()]
    assert [line.rstrip() for line in table.splitlines()] == printed[: len(table.splitlines())]


def test_set_up_commands_install_what_they_run():
    install, test = (block.strip() for block in blocks("sh"))
    assert install.endswith("python -m cmacexp scenario=one_leg")
    assert test.endswith("python -m pytest")
    assert (ROOT / ".ci" / "run").read_text().count("README.md") == 1
