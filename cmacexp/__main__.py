"""``cmacexp COMMAND ...`` and ``python -m cmacexp COMMAND ...``: the command of that name, with the words after it.

Without a name of a command the words are overrides of a run, or with ``-m`` of a sweep.
"""

import signal
import sys
from contextlib import suppress
from importlib import import_module
from typing import cast

COMMANDS = {
    "run": "simulates a scenario: cmacexp run scenario=one_leg cycles=3",
    "sweep": "simulates variants: cmacexp sweep cmac.layers=8,16,32",
    "report": "writes a page of figures and tables of runs, or of a sweep",
    "replay": "shows a run in the Rerun viewer",
    "video": "draws a run, or several side by side, as a moving picture",
    "stability": "says whether learning holds, and with which lead",
    "score": "computes the metrics of runs again from their traces",
    "verify": "checks which runs are intact",
    "export": "writes a run for other programs: C, wide tables, MCAP",
    "gap": "compares a log of a robot with its model: identifies, validates, says what learning would gain",
    "robots": "shows what the model of a robot holds, and what follows from it",
    "robot": "plays a robot on this computer, for plant=unitree",
    "study": "runs a study and writes its report",
    "warm": "compiles what usual runs need, before they need it",
}
"""What each command does. All but the first two have a module of their own, which ``python -m cmacexp.NAME`` runs."""
RUNS = {"run": [], "sweep": ["-m"]}
"""Commands that take overrides, and the option that they stand for."""
HELP = """cmacexp: learned feedforward for hybrid position/force control of legs

{commands}

cmacexp COMMAND --help explains a command; cmacexp run --help lists the groups and fields that overrides change.
Without a command the words are overrides of a run: cmacexp scenario=one_leg
"""


def main() -> int:
    """The console script ``cmacexp``: as :func:`run_words`, but ``--help`` alone lists the commands."""
    if sys.argv[1:] in (["--help"], ["-h"], ["help"]):
        lines = [f"  {name:10} {meaning}" for name, meaning in COMMANDS.items()]
        print(HELP.format(commands="\n".join(lines)), end="")
        return 0
    return run_words()


def run_words() -> int:
    """Run the command that the words of the command line name; its exit code.

    Ctrl-C while its modules are imported ends the process without a traceback; from then on the command handles it.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name in RUNS:
        sys.argv[1:2] = RUNS[name]
    elif name in COMMANDS:
        del sys.argv[1]
        return cast(int, import_module(f"cmacexp.commands.{name}").main())
    elif name.isidentifier():
        from cmacexp.errors import suggest

        known = f"no such command; choose from {', '.join(COMMANDS)}"
        print(f"error: {name}: {known}{suggest(name, COMMANDS)}", file=sys.stderr)
        return 2
    if {"-m", "--multirun"} & set(sys.argv):
        from cmacexp.engine.pool import make_context

        with suppress(OSError):  # which the sweep raises again
            make_context()  # what workers need is imported while this process imports what it needs
    from cmacexp.commands.main import main as run

    return run()


if __name__ == "__main__":
    sys.exit(run_words())
