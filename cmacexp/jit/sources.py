"""Hashes of the sources, which identify their state."""

import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
KERNEL_ROOMS = (
    "jit", "data/signals.py", "models", "cmac", "planning", "plants", "sensors", "feedforward", "control", "loop",
)  # fmt: skip
"""Rooms and files with kernels, and with constants that kernels use."""
RESULT_ROOMS = (*KERNEL_ROOMS, "typing.py", "config", "data", "metrics", "experiment/run.py")
"""Rooms that can change the result of a run; not those that only read it."""


def sources_hash(rooms: Sequence[str], package: Path = PACKAGE) -> str:
    """Hash of every Python file of ``rooms`` (folders or files of ``package``), 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for room in rooms:
        path = package / room
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def code_hash() -> str:
    """Hash of all code that can change the result of a run of built-in components."""
    return sources_hash(RESULT_ROOMS)
