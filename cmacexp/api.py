"""Runs from Python, as from the command line: :func:`run` one, :func:`load` an old one."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from cmacexp.config.compose import compose_config
from cmacexp.errors import BadInput
from cmacexp.parts import METHODS
from cmacexp.run_one import run_scenario
from cmacexp.scenario import make_scenario
from cmacexp.stored import StoredRun

RUN_FOLDER = "hydra.run.dir="


def _split(overrides: Sequence[str]) -> tuple[list[str], Path | None]:
    """Overrides of the config, and the folder that they name."""
    folder = None
    for text in overrides:
        if text.startswith(RUN_FOLDER):
            folder = Path(text.removeprefix(RUN_FOLDER))
        elif text.startswith(("-", "hydra.", "hydra/")):
            raise BadInput("overrides", text, "is of the command line alone; here give config overrides")
    return [text for text in overrides if not text.startswith("hydra.")], folder


def run(
    overrides: Sequence[str] = (),
    folder: str | Path | None = None,
    *,
    config_dir: str | Path | None = None,
    **parts: object,
) -> StoredRun:
    """The same run as ``python -m cmacexp`` with these overrides.

    Args:
        overrides: as typed on the command line, e.g. ``["scenario=one_leg", "cycles=3"]``.
        folder: where the run is kept; None: ``outputs/<scenario>/<date and time>``, as on the command line.
        config_dir: a folder of one's own configs, as ``--config-dir``.
        parts: objects that take the place of ``plant``, ``sensors``, ``controller`` or ``feedforward``.

    Returns:
        The run, however it ended: see its ``status``.

    Raises:
        CmacexpError: it cannot be run; a :class:`BadInput` names key, value and what is allowed.
        OSError: the folder cannot be written.
    """
    chosen, named = _split(overrides)
    unknown = set(parts) - set(METHODS)
    if unknown:
        raise BadInput("run", ", ".join(sorted(unknown)), f"takes objects for {', '.join(METHODS)}")
    config = compose_config(chosen, config_dir)
    targets: dict[str, Any] = {
        key: {"_target_": f"{type(part).__module__}.{type(part).__qualname__}"} for key, part in parts.items()
    }
    config = replace(config, **targets)
    place = Path(folder) if folder is not None else named
    if place is None:
        place = Path("outputs", config.scenario, datetime.now().strftime("%Y-%m-%d_%H-%M-%S-%f"))
    return StoredRun(run_scenario(config, place, prepared=make_scenario(config, **parts)).folder)


def load(folder: str | Path) -> StoredRun:
    """A run of before, by its folder.

    Raises:
        BadRun: it is not the folder of a run that came to its end.
    """
    stored = StoredRun(Path(folder))
    _ = stored.manifest
    return stored
