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
    "score": "computes the metrics of runs again from their traces",
    "verify": "checks which runs are intact",
    "robots": "shows what the model of a robot holds, and what follows from it",
    "warm": "compiles what usual runs need, before they need it",
}
"""What the commands of the core do; all but the first two have a module of their own. Add-ons have more."""
RUNS = {"run": [], "sweep": ["-m"]}
"""Commands that take overrides, and the option that they stand for."""
HELP = """cmacexp: learned feedforward for hybrid position/force control of legs

{commands}

cmacexp COMMAND --help explains a command; cmacexp run --help lists the groups and fields that overrides change.
Without a command the words are overrides of a run: cmacexp scenario=one_leg
"""


def main() -> int:
    """Run the console script ``cmacexp``: as :func:`run_words`, but ``--help`` alone lists the commands."""
    if sys.argv[1:] in (["--help"], ["-h"], ["help"]):
        from cmacexp.entry_points import describe_command, list_commands

        commands = COMMANDS | {name: describe_command(point) for name, point in list_commands().items()}
        lines = [f"  {name:10} {meaning}" for name, meaning in commands.items()]
        print(HELP.format(commands="\n".join(lines)), end="")
        return 0
    return run_words()


def run_named(name: str) -> int:
    """Run the command of a name, of the core or of an add-on, with the words of the command line; its exit code."""
    if name in COMMANDS:
        return cast(int, import_module(f"cmacexp.commands.{name}").main())
    from cmacexp.entry_points import list_commands
    from cmacexp.errors import suggest

    commands = list_commands()
    if name in commands:
        return cast(int, commands[name].load()())
    names = [*COMMANDS, *commands]
    known = f"no such command; choose from {', '.join(names)}"
    print(f"error: {name}: {known}{suggest(name, names)}", file=sys.stderr)
    return 2


def run_words() -> int:
    """Run the command that the words of the command line name; its exit code.

    Ctrl-C while its modules are imported ends the process without a traceback; from then on the command handles it.
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
        from cmacexp.engine.workers import make_context

        with suppress(OSError):  # which the sweep raises again
            make_context()  # what workers need is imported while this process imports what it needs
    from cmacexp.commands.command import run_command
    from cmacexp.commands.main import run_or_sweep

    return run_command(run_or_sweep)


if __name__ == "__main__":
    sys.exit(run_words())
