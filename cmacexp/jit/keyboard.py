"""Ctrl-C from the first moment of a command on: what has to stand before anything that takes time is imported.

Until :func:`begin_command`, which the package calls first of all, an interrupt ends a command with a stack trace.
Therefore this imports next to nothing; :mod:`cmacexp.jit.interrupt` is what the rest of the project uses.
"""

import os.path
import signal
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType

COMMANDS = ("cmacexp", "pipelines")
"""Packages whose modules are commands, and the name of the script."""


class Keyboard:
    """Interrupts of this process."""

    holds = False
    """Whether an interrupt waits."""
    waits = False
    """Whether one does."""
    is_command = False
    blocked = False
    """Whether the main thread blocks them, so that another one receives them for it."""


def handle(number: int, frame: "FrameType | None") -> None:
    """Note an interrupt that has to wait; a second one does not."""
    if Keyboard.holds and not Keyboard.waits:
        Keyboard.waits = True
        return
    Keyboard.waits = False
    raise KeyboardInterrupt


def _name_command() -> str:
    """The module that Python runs, or the name of its script."""
    if sys.argv[:1] == ["-m"]:  # Python imports the packages of the module that follows
        return sys.orig_argv[sys.orig_argv.index("-m") + 1]
    main = sys.modules["__main__"]
    spec, file = getattr(main, "__spec__", None), getattr(main, "__file__", None)
    return str(spec.name) if spec is not None else os.path.basename(file or "")


def begin_command() -> None:
    """Hold back interrupts while a command imports its modules, until ``heed_interrupts``; else do nothing."""
    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_default and _name_command().partition(".")[0] in COMMANDS:
        signal.signal(signal.SIGINT, handle)
        Keyboard.holds = Keyboard.is_command = True
