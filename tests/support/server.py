"""Runs ``python -m MODULE`` in a fork of a process that has imported what takes most of the time of a command.

Reads a request a line: folder, files for its output and errors, words after ``-m``; answers with the exit code.
"""

import importlib
import json
import os
import runpy
import sys
import threading
import traceback
from typing import NoReturn

IMPORTED = (
    "cmacexp.commands.main",
    "cmacexp.engine",
    "cmacexp.terminal.messages",
    "cmacexp.report.page",
    "pandas",
    "rerun",
    "matplotlib.pyplot",
)


def execute(folder: str, output: str, errors: str, words: list[str]) -> NoReturn:
    """What the interpreter does of the command, to its end."""
    os.chdir(folder)
    for number, path in ((1, output), (2, errors)):
        os.dup2(os.open(path, os.O_WRONLY), number)
    sys.argv, sys.path[0] = words, folder
    code: object = 0
    try:
        runpy.run_module(words[0], run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
        code = 1
    if isinstance(code, str):
        print(code, file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else int(code is not None))


if __name__ == "__main__":
    for name in IMPORTED:
        importlib.import_module(name)
    # How busy the machine is decides which lines of progress come after seconds.
    vars(sys.modules["cmacexp.terminal.messages"])["FIRST_LINE_DELAY"] = threading.TIMEOUT_MAX
    for line in sys.stdin:
        process = os.fork()
        if not process:
            execute(*json.loads(line))
        print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)
