"""``cmacexp COMMAND ...`` and ``python -m cmacexp COMMAND ...``: the command of that name, with the words after it.

Without a name of a command the words are overrides of a run, or with ``-m`` of a sweep.
"""

import sys
from difflib import get_close_matches
from importlib import import_module
from typing import cast

COMMANDS = ("export", "replay", "report", "robots", "score", "stability", "study", "verify")
"""Those with a module of their own; ``python -m cmacexp.NAME`` runs them too."""
RUNS = {"run": [], "sweep": ["-m"]}
"""Those that take overrides, and the option that they stand for."""


def main() -> int:
    """Run the command line; its exit code."""
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name in COMMANDS:
        del sys.argv[1]
        return cast(int, import_module(f"cmacexp.commands.{name}").main())
    if name in RUNS:
        sys.argv[1:2] = RUNS[name]
    elif name.isidentifier() and (close := get_close_matches(name, (*COMMANDS, *RUNS), 1)):
        print(f"error: {name}: no such command; did you mean {close[0]}?", file=sys.stderr)
        return 2
    if {"-m", "--multirun"} & set(sys.argv):
        from cmacexp.engine.forking import make_context

        make_context()  # what workers need is imported while this process imports what it needs
    from cmacexp.commands.main import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
