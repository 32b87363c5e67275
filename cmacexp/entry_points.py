"""What add-ons, and packages of users, add: commands and views of a run, by entry points.

A package declares them in its ``pyproject.toml``, as this one does for its own add-ons::

    [project.entry-points."cmacexp.commands"]
    name = "my_package.my_module:main"

``cmacexp name`` then calls ``main()``, which returns an exit code. A view is called by the core with what its place
says: ``report``, ``view`` and others of a run, ``meshes`` of a recording, ``table`` of recordings.
"""

import ast
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cmacexp.errors import CmacexpError

COMMANDS, VIEWS = "cmacexp.commands", "cmacexp.views"
"""Groups of entry points."""


def list_commands() -> dict[str, EntryPoint]:
    """List the commands of add-ons and of other packages, by name."""
    return {point.name: point for point in sorted(entry_points(group=COMMANDS), key=lambda point: point.name)}


def describe_command(point: EntryPoint) -> str:
    """Describe a command in a line, from the docstring of its module, which is not imported; empty without one."""
    try:
        spec = find_spec(point.module)
        text = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
        first = (ast.get_docstring(ast.parse(text)) or "").split("\n")[0]
    except (ImportError, OSError, SyntaxError, ValueError):
        return ""
    return first.rpartition("``: ")[2].rstrip(".")


@cache
def load_view(name: str) -> Any:
    """Load the view of a name; raises CmacexpError if no package has it."""
    points = list(entry_points(group=VIEWS, name=name))
    CmacexpError.unless(points, f"no installed package has the view {name}: install this one again")
    return points[0].load()
