"""What a run that could not be made leaves: a manifest that says why."""

from typing import Any

from omegaconf import DictConfig, OmegaConf

from cmacexp.data import manifest as manifests
from cmacexp.errors import BadComponent, BadInput, CmacexpError, format_user_traceback
from cmacexp.typing import Status


def describe_failure(error: Exception) -> str:
    """Why a run failed, in one line."""
    text = str(error) if isinstance(error, CmacexpError | OSError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())


def make_failure(composed: DictConfig | dict[str, Any], error: Exception, **entries: Any) -> manifests.Manifest:
    """The manifest of a run of a ``composed`` config that failed before its first step."""
    plain: Any = composed
    if isinstance(composed, DictConfig):
        plain = OmegaConf.to_container(composed)  # as typed: an interpolation may be what is wrong
    entries["bad_input"] = isinstance(error, BadInput)
    if isinstance(error, BadComponent) or not isinstance(error, CmacexpError | OSError | MemoryError):
        entries["traceback"] = format_user_traceback(error.raised if isinstance(error, BadComponent) else error)
    return manifests.make_manifest(plain, Status.FAILED, describe_failure(error), **entries)
