"""The command line."""

from cmacexp.interrupt import begin_command

begin_command()
