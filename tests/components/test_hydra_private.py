"""Runs and sweeps are the same with a version of Hydra whose private names are not known."""

import pytest
from support.command import python

RUN = """
import sys
from cmacexp.config import hydra_private
hydra_private.__version__ = "{version}"
from hydra._internal.hydra import Hydra
lookup = Hydra.get_mode
from cmacexp.commands.main import main
sys.argv = ["cmacexp", *{arguments}]
code = main()
print("changed" if Hydra.get_mode is not lookup else "unchanged", file=sys.stderr)
sys.exit(code)
"""
COMMANDS = {
    "run": ["cycles=1", "record=trace", "feedforward=none", "hydra.run.dir=out"],
    "sweep": ["-m", "seed=0,1", "cycles=1", "feedforward=none", "hydra.sweep.dir=out"],
}


@pytest.mark.parametrize("kind", COMMANDS)
def test_a_command_gives_the_same_without_private_names(kind, tmp_path):
    files = []
    for version, changed in (("1.3.2", "changed"), ("1.4.0", "unchanged")):
        folder = tmp_path / version
        folder.mkdir()
        done = python("-c", RUN.format(version=version, arguments=COMMANDS[kind]), folder=folder)
        assert done.returncode == 0, done.stderr
        assert done.stderr.splitlines()[-1] == changed
        files.append({path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*.parquet"))})
    assert files[0] == files[1] != {}


WRONG = """
import argparse, sys
from cmacexp.commands.main import main
before = argparse.ArgumentParser.error
sys.argv = ["cmacexp", "--unheard-of"]
try:
    main()
except SystemExit as end:
    print(end.code, argparse.ArgumentParser.error is before)
"""


def test_a_wrong_option_is_one_line_and_the_parsers_of_others_stay_as_they_are(tmp_path):
    done = python("-c", WRONG, folder=tmp_path)
    assert done.stdout == "2 True\n"
    assert done.stderr.startswith("error: unrecognized arguments: --unheard-of; ")
    assert done.stderr.count("\n") == 1
