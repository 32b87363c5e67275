"""Make the components of a run: of the class that each names by ``_target_``, with the fields that it takes."""

import inspect
from functools import lru_cache
from typing import Any

from cmacexp.config import ComponentConfig
from cmacexp.config.component import current_folder_importable, find_class
from cmacexp.control.protocol import Controller
from cmacexp.errors import BadComponent, BadInput, format_install_command
from cmacexp.feedforward.protocol import Feedforward
from cmacexp.jit.interrupt import exits_caught
from cmacexp.plants import Plant
from cmacexp.sensors import Sensors

PROTOCOLS = {"plant": Plant, "sensors": Sensors, "controller": Controller, "feedforward": Feedforward}


def require_members(group: str, target: object, component: object) -> None:
    """Require that a component has all that its protocol names; raises BadInput."""
    protocol = PROTOCOLS[group]
    members = [name for name in (*vars(protocol), *protocol.__annotations__) if not name.startswith("_")]
    missing = [name for name in members if not hasattr(component, name)]
    if missing:
        raise BadInput(f"{group}._target_", target, f"is not a {group}: it has no {' and no '.join(missing)}")


@lru_cache(64)  # the jobs of a sweep have few classes
def require_class(group: str, target: object, component: type[Any], given: tuple[str, ...]) -> None:
    """Require, before anything of a class is called, that it has the methods of its protocol; raises BadInput."""
    protocol, key = PROTOCOLS[group], f"{group}._target_"
    methods = [name for name, value in vars(protocol).items() if inspect.isfunction(value) and name[0] != "_"]
    if missing := [name for name in methods if not callable(getattr(component, name, None))]:
        raise BadInput(key, target, f"is not a {group}: it has no {' and no '.join(missing)}")
    for name in methods:
        if not _takes(component, name, taken := list(inspect.signature(getattr(protocol, name)).parameters)):
            raise BadInput(key, target, f"is not a {group}: {name} must take ({', '.join(taken[1:])})")
    try:
        inspect.signature(component).bind(**dict.fromkeys(given))
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


def make_component(group: str, node: ComponentConfig | dict[str, Any]) -> Any:
    """Make a component: with its ``Config``, if its class carries one, else with its fields as keyword arguments.

    Raises BadInput; as :class:`BadComponent` with the traceback of what its own code raised.
    """
    if isinstance(node, ComponentConfig):
        target, given = node._target_, {"config": node}
    else:
        target, given = node["_target_"], {name: value for name, value in node.items() if name != "_target_"}
    key = f"{group}._target_"
    with current_folder_importable():
        component = find_class(key, target)
        require_class(group, target, component, tuple(given))  # type: ignore[arg-type]  # any class is hashable
        try:
            with exits_caught():
                made = component(**given)
        except BadInput:
            raise
        except Exception as error:
            if isinstance(error, ModuleNotFoundError) and (command := format_install_command(error.name or "")):
                raise BadInput(key, target, f"needs {error.name}, which is not installed: {command}") from error
            reason = f"cannot be made: {type(error).__name__}: {' '.join(str(error).split())}"
            raise BadComponent(key, target, reason, error) from error
    require_members(group, target, made)
    return made
