"""Where the shipped configs stand."""

from functools import cache
from pathlib import Path


@cache
def config_folder() -> Path:
    """The folder of the shipped configs: inside an installed package, else at the top of the checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"
