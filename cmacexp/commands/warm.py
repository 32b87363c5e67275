"""``python -m cmacexp.warm``: compiles what usual runs need, so that none of them has to wait for it."""

import time

from cmacexp.commands.command import Arguments, command
from cmacexp.errors import CmacexpError, require_name
from cmacexp.terminal.output import print_line, show_activity

FORMS = {
    "one_leg": ["scenario=one_leg"],
    "guarded": ["scenario=one_leg", "cycles=2", "learning.guard=freeze"],
    "robot": ["scenario=robot"],
}
"""Overrides of a run of each form of the control loop that usual runs need: the first two serve every machine with
planar legs and all sensors, without and with a guard of learning."""
MANY = 10**6
"""Runs that repay compiling everything that many runs use."""


@command(
    "warm",
    "Compile what usual runs need, once for a version, before they need it.",
    {"forms": {"nargs": "*", "metavar": "FORM", "help": f"{', '.join(FORMS)}; without one: all"}},
)
def main(arguments: Arguments) -> None:
    """Compile the forms; raises BadInput if there is no such form."""
    for name in arguments.forms:
        require_name("FORM", name, FORMS)
    from cmacexp.engine.batch import METRICS, run_chunk

    for name in arguments.forms or FORMS:
        began = time.monotonic()
        try:
            with show_activity(f"compiling {name}"):
                run_chunk(0, [["cycles=1", *FORMS[name]]], METRICS, MANY)
        except CmacexpError as error:  # what it needs is not installed
            print_line(f"{name}: left out: {error}")
        else:
            print_line(f"{name}: ready after {time.monotonic() - began:.1f} s")
