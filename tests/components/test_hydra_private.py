"""Private names of Hydra: their use changes nothing for other programs."""

from support.command import python

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
