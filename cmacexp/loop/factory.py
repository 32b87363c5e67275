"""Make the components of a run from the ``_target_`` and fields of their config nodes."""

import inspect
from collections.abc import Mapping
from typing import Any

from hydra.errors import InstantiationException
from hydra.utils import instantiate

from cmacexp.config.targets import current_folder_importable, find_class
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


def require_class(group: str, node: Mapping[str, Any]) -> None:
    """Require that a ``_target_`` is a class with the methods of its protocol, before anything of it is called.

    Args:
        group: of the component, ``controller``.
        node: its ``_target_`` and fields.

    Raises:
        BadInput: names the method that is missing or takes other arguments, or the fields that do not fit.
    """
    target, protocol, key = node.get("_target_"), PROTOCOLS[group], f"{group}._target_"
    component = find_class(key, target)
    methods = [name for name, value in vars(protocol).items() if inspect.isfunction(value) and name[0] != "_"]
    if missing := [name for name in methods if not callable(getattr(component, name, None))]:
        raise BadInput(key, target, f"is not a {group}: it has no {' and no '.join(missing)}")
    for name in methods:
        if not _takes(component, name, given := list(inspect.signature(getattr(protocol, name)).parameters)):
            raise BadInput(key, target, f"is not a {group}: {name} must take ({', '.join(given[1:])})")
    try:
        inspect.signature(component).bind(**{name: value for name, value in node.items() if name != "_target_"})
    except TypeError as error:
        raise BadInput(key, target, f"cannot be made of its fields: {error}") from error
    except ValueError:  # a class that is not written in Python
        return


def _takes(component: type[Any], name: str, given: list[str]) -> bool:
    """Whether a method can be called with ``given``, of which the first is the object itself."""
    declared = inspect.getattr_static(component, name)
    is_bound = hasattr(declared, "__get__") and not isinstance(declared, staticmethod | classmethod)
    try:
        inspect.signature(getattr(component, name)).bind(*(given if is_bound else given[1:]))
    except TypeError:
        return False
    except ValueError:  # it is not written in Python
        return True
    return True


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
            require_class(group, node)
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
