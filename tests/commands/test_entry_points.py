"""A package of a user adds a command and a plant, as the add-ons of this one do: by entry points."""

import pytest
from support.command import python

OWN = '''"""``cmacexp greet``: greets whoever installed it."""

import sys

from cmacexp.plants import AnalyticPlant


class HeavyPlant(AnalyticPlant):
    """A plant of a user."""


def main():
    print("greetings to", *sys.argv[1:])
    return 3
'''
POINTS = """[cmacexp.commands]
greet = own_robot:main
"""


@pytest.fixture
def installed(tmp_path):
    """The folder of an installed package, whose metadata are as an installer writes them."""
    (tmp_path / "own_robot.py").write_text(OWN)
    metadata = tmp_path / "own_robot-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: own-robot\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(POINTS)
    return tmp_path


@pytest.mark.ci
def test_a_package_of_a_user_adds_a_command_and_a_plant(installed, tmp_path):
    def run(*words):
        return python("-m", "cmacexp", *words, folder=tmp_path, PYTHONPATH=str(installed))

    assert "greet      greets whoever installed it" in python(
        "-c", "import sys; sys.argv[1:] = ['--help']; from cmacexp.__main__ import main; main()",
        folder=tmp_path, PYTHONPATH=str(installed),
    ).stdout  # fmt: skip
    done = run("greet", "you")
    assert (done.returncode, done.stdout) == (3, "greetings to you\n")
    done = run("plant._target_=own_robot.HeavyPlant", "cycles=1", "record=metrics", "hydra.run.dir=run")
    assert done.returncode == 0, done.stderr
    assert "no such command; choose from run," in run("greets").stderr
