"""``python -m cmacexp.warm``: compiles the control loop of common runs ahead of time."""

import time

from cmacexp.commands.command import Arguments, command
from cmacexp.errors import CmacexpError, require_name
from cmacexp.terminal.output import print_line, show_activity

FORMS = {
    "one_leg": ["scenario=one_leg"],
    "guarded": ["scenario=one_leg", "cycles=2", "learning.guard=freeze"],
    "robot": ["scenario=robot"],
}
"""Overrides of a run for each compiled form of the control loop.

The first two serve every machine with planar legs and all sensors, without and with a guard of learning.
"""
MANY = 10**6
"""Number of runs for which it pays off to compile everything."""


@command(
    "warm",
    "Compile the control loop of common runs ahead of time, once for each version of the code.",
    {
        "forms": {
            "nargs": "*",
            "metavar": "FORM",
            "help": f"form of the control loop: {', '.join(FORMS)} (default: all)",
        }
    },
)
def main(arguments: Arguments) -> None:
    """Compile the named forms of the control loop; raises BadInput for an unknown name."""
    for name in arguments.forms:
        require_name("FORM", name, FORMS)
    from cmacexp.engine.batch import METRICS, run_chunk

    for name in arguments.forms or FORMS:
        began = time.monotonic()
        try:
            with show_activity(f"compiling {name}"):
                run_chunk(0, [["cycles=1", *FORMS[name]]], METRICS, MANY)
        except CmacexpError as error:  # an extra is not installed
            print_line(f"{name}: left out: {error}")
        else:
            print_line(f"{name}: ready after {time.monotonic() - began:.1f} s")
