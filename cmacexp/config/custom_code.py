"""The code of custom components: of their files, and of the files beside them that they import; and their data."""

import hashlib
import os
import sys
import sysconfig
from collections.abc import Iterable
from functools import cache
from modulefinder import ModuleFinder
from pathlib import Path

from cmacexp.config.component import COMPONENTS
from cmacexp.config.schema import Config
from cmacexp.config.targets import current_folder_importable, find_class

PACKAGE = __name__.partition(".")[0]


def custom_code_hash(config: Config, *components: object) -> str | None:
    """SHA-256 of the code of the custom components of a run, as it was imported; None: all are built in.

    Files of data count too: those that a field of the component names, and those that its class lists as ``reads``,
    absolute or relative to the current folder. Without ``components`` that were made or given, it is that of those
    that the config names; raises BadInput.
    """
    nodes = [getattr(config, group) for group in COMPONENTS]
    nodes = [node if isinstance(node, dict) else vars(node) for node in nodes]
    classes = [type(component) for component in components]
    for group, node in () if components else zip(COMPONENTS, nodes, strict=True):
        with current_folder_importable():
            classes.append(find_class(f"{group}._target_", node["_target_"]))
    hashes = list[str]()
    for own, node in zip(classes, nodes, strict=True):
        if own.__module__.partition(".")[0] != PACKAGE:
            hashes += [_hash(own.__module__), *_hash_data([*getattr(own, "reads", ()), *node.values()])]
    return hashlib.sha256("".join(hashes).encode()).hexdigest() if hashes else None


def _hash_data(named: Iterable[object]) -> list[str]:
    """SHA-256 of each of ``named`` that is the path of a file."""
    files = [Path(name) for name in named if isinstance(name, str | Path) and os.path.isfile(name)]
    return [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]


@cache
def _hash(module: str) -> str:
    digest = hashlib.sha256()
    for path in find_sources(module):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def find_sources(name: str) -> list[Path]:
    """Files of an imported module and of those beside its top package that it imports, directly or not.

    Not those of this package, and of installed packages not those of others.
    """
    file = Path(getattr(sys.modules.get(name), "__file__", None) or ".")
    if not file.is_file():  # written in a console
        return []
    root = file.parents[name.count(".") + (file.name == "__init__.py")]
    others = [PACKAGE]
    if str(root) in (sysconfig.get_path("purelib"), sysconfig.get_path("platlib")):
        others += [path.name.partition(".")[0] for path in root.iterdir()]
    finder = ModuleFinder([str(root)], excludes=[each for each in others if each != name.partition(".")[0]])
    if name == "__main__":
        finder.run_script(str(file))
    else:
        finder.import_hook(name)
    files = [getattr(module, "__file__", None) for module in finder.modules.values()]
    return sorted(Path(file) for file in files if file)
