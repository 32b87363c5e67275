"""Make the components of a run from the ``_target_`` and fields of their config nodes."""

from collections.abc import Mapping
from typing import Any

from hydra.errors import InstantiationException
from hydra.utils import instantiate

from cmacexp.config.targets import current_folder_importable
from cmacexp.control.protocol import Controller
from cmacexp.errors import BadComponent, BadInput, format_install_command
from cmacexp.feedforward.protocol import Feedforward
from cmacexp.plants import Plant
from cmacexp.sensors import Sensors

PROTOCOLS = {"plant": Plant, "sensors": Sensors, "controller": Controller, "feedforward": Feedforward}
"""Protocol of each component, by the key of its group."""


def require_members(group: str, target: object, component: object) -> None:
    """Require that a component has all that its protocol names.

    Raises:
        BadInput: names what it lacks.
    """
    protocol = PROTOCOLS[group]
    members = [name for name in (*vars(protocol), *protocol.__annotations__) if not name.startswith("_")]
    missing = [name for name in members if not hasattr(component, name)]
    if missing:
        raise BadInput(f"{group}._target_", target, f"is not a {group}: it has no {' and no '.join(missing)}")


def make_component(group: str, node: Mapping[str, Any]) -> Any:
    """Make a component.

    Args:
        group: its group, ``controller``.
        node: its ``_target_`` and fields.

    Raises:
        BadInput: it cannot be made; as :class:`BadComponent` with the traceback of what its own code raised.
    """
    target, key = node.get("_target_"), f"{group}._target_"
    try:
        with current_folder_importable():
            component = instantiate(node)
    except InstantiationException as error:
        raise _explain(key, target, error) from error.__cause__
    require_members(group, target, component)
    return component


def _explain(key: str, target: object, error: InstantiationException) -> BadInput:
    """The error in one line."""
    cause = error.__cause__
    if isinstance(cause, BadInput):
        return cause
    if isinstance(cause, ModuleNotFoundError) and (command := format_install_command(cause.name or "")):
        return BadInput(key, target, f"needs {cause.name}, which is not installed: {command}")
    reason = " ".join(str(cause or error).split())
    if cause is None:
        return BadInput(key, target, f"cannot be made: {reason}")
    return BadComponent(key, target, f"cannot be made: {type(cause).__name__}: {reason}", cause)
