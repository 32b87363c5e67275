"""The mistakes that users can make, one exception each; every message is one line that says how to mend it."""

import importlib
import sys
import traceback
from pathlib import Path
from types import TracebackType

EXTRAS = {"mujoco": "mujoco"}
"""Modules that come with an extra of this package."""


def install(extra: str) -> str:
    """How to install an extra."""
    return f'python -m pip install -e ".[{extra}]" in the checkout'


def install_command(module: str) -> str:
    """How to install a module that comes with an extra; empty if it comes with none."""
    extra = EXTRAS.get(module.partition(".")[0])
    return install(extra) if extra else ""


def _is_users(frame: TracebackType) -> bool:
    hydra, ours = sys.modules.get("hydra"), Path(__file__).parent
    file = Path(frame.tb_frame.f_code.co_filename)
    theirs = [Path(importlib.__file__).parent, Path(hydra.__file__ or "").parent] if hydra else []
    return "<frozen" not in str(file) and not any(file.is_relative_to(folder) for folder in [ours, *theirs])


def users_traceback(error: BaseException) -> str:
    """The traceback of an error from the first frame on that is not the project's, Hydra's or the import system's.

    It is whole if all frames are; none is shown of a file that cannot be read as Python.
    """
    at = error.__traceback__
    while at is not None and not _is_users(at):
        at = at.tb_next
    if at is None and not isinstance(error, SyntaxError):
        at = error.__traceback__
    return "".join(traceback.format_exception(type(error), error, at))


class CmacexpError(Exception):
    """Base class: its message is meant for the user and is shown without a stack trace."""


class BadInput(CmacexpError):
    """A configuration that cannot be run; raised before anything is simulated (exit code 2).

    Args:
        key: the config key as typed on the command line, e.g. ``cmac.layers``.
        value: the value found there.
        allowed: what is allowed, and how to mend it.
    """

    def __init__(self, key: str, value: object, allowed: str):
        super().__init__(key, value, allowed)  # all of them, so that it comes back whole from another process
        self.key = key

    def __str__(self) -> str:
        key, value, allowed, *_ = self.args
        return f"{key}={value}: {allowed}"


class BadPart(BadInput):
    """A part whose own code raised when it was imported or made.

    Args:
        key: as of :class:`BadInput`.
        value: likewise.
        reason: what it raised, in a line.
        raised: what it raised.
    """

    def __init__(self, key: str, value: object, reason: str, raised: BaseException):
        super().__init__(key, value, " ".join(reason.split()))
        self.args = (*self.args, raised)
        self.raised = raised


class BadAnswer(CmacexpError):
    """A part gave back what the loop cannot use; the message names class, method, what was expected and what came."""


class BadRun(CmacexpError):
    """A folder that does not hold what a run leaves behind."""
