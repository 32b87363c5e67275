"""``cmacexp COMMAND ...`` and ``python -m cmacexp COMMAND ...``: run a command with the arguments that follow.

Without a command the arguments are overrides of a run or, with ``-m``, of a sweep.
"""

import os
import signal
import sys
from importlib import import_module
from typing import cast

COMMANDS = {
    "run": "simulates a scenario: cmacexp run scenario=one_leg cycles=3",
    "sweep": "simulates all combinations of values: cmacexp sweep cmac.layers=8,16,32",
    "report": "writes a page with figures and tables of runs or of a sweep",
    "replay": "shows a run in the Rerun viewer",
    "score": "recomputes the metrics of runs from their traces",
    "verify": "checks that the files of runs are present and unchanged",
    "robots": "prints a robot model, its delay margin and the derived settings",
    "warm": "compiles the control loop of common runs ahead of time",
}
"""Core commands and what they do; all except the first two are modules of :mod:`cmacexp.commands`."""
RUNS = {"run": [], "sweep": ["-m"]}
"""Commands that take overrides, with the options of Hydra that they stand for."""
HELP = """cmacexp: learned feedforward for hybrid position/force control of legs

{commands}

cmacexp COMMAND --help explains a command; cmacexp run --help lists the groups and fields that overrides change.
Without a command the arguments are overrides of a run: cmacexp scenario=one_leg
"""

# Matrices are small. On a busy computer threads of OpenBLAS wait for each other: ``gap`` took six times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main() -> int:
    """Run the console script ``cmacexp``: list the commands for a sole ``--help``, else call :func:`run_words`."""
    if sys.argv[1:] in (["--help"], ["-h"], ["help"]):
        from cmacexp.entry_points import describe_command, list_commands

        commands = COMMANDS | {name: describe_command(point) for name, point in list_commands().items()}
        lines = [f"  {name:10} {meaning}" for name, meaning in commands.items()]
        print(HELP.format(commands="\n".join(lines)), end="")
        return 0
    return run_words()


def run_named(name: str) -> int:
    """Run the command ``name`` of the core or an add-on with the arguments of this process; return its exit code."""
    if name in COMMANDS:
        return cast(int, import_module(f"cmacexp.commands.{name}").main())
    from cmacexp.entry_points import list_commands
    from cmacexp.errors import suggest

    commands = list_commands()
    if name in commands:
        return cast(int, commands[name].load()())
    names = [*COMMANDS, *commands]
    reason = f"no such command; choose from {', '.join(names)}"
    print(f"error: {name}: {reason}{suggest(name, names)}", file=sys.stderr)
    return 2


def run_words() -> int:
    """Run the command, run or sweep of the command line and return its exit code.

    Ctrl-C during the import of its modules ends the process without a traceback; afterwards the command handles it.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name in RUNS:
        sys.argv[1:2] = RUNS[name]
    elif name.isidentifier():
        del sys.argv[1]
        return run_named(name)
    if {"-m", "--multirun"} & set(sys.argv):
        from cmacexp.engine.workers import prepare_pool

        prepare_pool()
    from cmacexp.commands.command import run_command
    from cmacexp.commands.main import run_or_sweep

    return run_command(run_or_sweep)


if __name__ == "__main__":
    sys.exit(run_words())
