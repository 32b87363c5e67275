"""Entry points by which add-ons and packages of users add commands and views of a run.

A package declares them in its ``pyproject.toml``, as this one does for its own add-ons::

    [project.entry-points."cmacexp.commands"]
    name = "my_package.my_module:main"

``cmacexp name`` then calls ``main()``, which returns an exit code. The core calls a view with the arguments for its
name: ``report``, ``view`` and others get a run, ``meshes`` gets a recording, ``table`` gets runs.
"""

import ast
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cmacexp.errors import CmacexpError

COMMAND_GROUP = "cmacexp.commands"
"""Group of the entry points of commands."""
VIEW_GROUP = "cmacexp.views"
"""Group of the entry points of views."""


def list_commands() -> dict[str, EntryPoint]:
    """List the commands of add-ons and other packages, by name."""
    return {point.name: point for point in sorted(entry_points(group=COMMAND_GROUP), key=lambda point: point.name)}


def describe_command(point: EntryPoint) -> str:
    """Describe a command in one line, from the docstring of its module, which is not imported; empty without one."""
    try:
        spec = find_spec(point.module)
        text = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
        first = (ast.get_docstring(ast.parse(text)) or "").split("\n")[0]
    except (ImportError, OSError, SyntaxError, ValueError):
        return ""
    return first.rpartition("``: ")[2].rstrip(".")


@cache
def load_view(name: str) -> Any:
    """Load the view ``name``; raises CmacexpError if no package has it."""
    points = list(entry_points(group=VIEW_GROUP, name=name))
    CmacexpError.unless(points, f"no installed package has the view {name}: install this one again")
    return points[0].load()
