"""Runs from Python, as from the command line: ``run`` one, ``load`` an old one, ``open_loop`` to step one."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from cmacexp.config import to_config
from cmacexp.config.component import COMPONENTS
from cmacexp.config.compose import compose_untyped
from cmacexp.config.machine import describe_other_model
from cmacexp.data.run import Run as Run
from cmacexp.engine.run import run_scenario
from cmacexp.engine.without_effect import list_idle_overrides
from cmacexp.errors import BadInput, OtherModel, WithoutEffect
from cmacexp.jit.compiler import expect_steps
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.stepwise import OpenLoop
from cmacexp.terminal.messages import announce_compiling, describe_idle

RUN_FOLDER = "hydra.run.dir="


def _split(overrides: str | Sequence[str]) -> tuple[list[str], Path | None]:
    """Overrides of the config, and the folder that ``hydra.run.dir`` names."""
    if isinstance(overrides, str):
        if len(words := overrides.split()) > 1:
            raise BadInput("overrides", overrides, f"must be a list: {words}")
        overrides = words
    folder = None
    for text in overrides:
        if text.startswith(RUN_FOLDER):
            folder = Path(text.removeprefix(RUN_FOLDER))
        elif text.startswith(("-", "hydra.", "hydra/")):
            raise BadInput("overrides", text, "is an option of the command line; give config overrides only")
    return [text for text in overrides if not text.startswith("hydra.")], folder


def run(
    overrides: str | Sequence[str] = (),
    folder: str | Path | None = None,
    *,
    config_dir: str | Path | None = None,
    **components: object,
) -> Run:
    """The same run as ``python -m cmacexp`` with these overrides.

    Args:
        overrides: as typed on the command line, e.g. ``["scenario=one_leg", "cycles=3"]``; a string is one of them.
        folder: of the run; None: ``outputs/<scenario>/<date and time>``, as on the command line.
        config_dir: a folder of custom configs, as ``--config-dir``.
        components: objects to use as ``plant``, ``sensors``, ``controller`` or ``feedforward``.

    Returns:
        The run; its ``status`` says how it ended.

    Raises:
        CmacexpError: it cannot be run; a ``BadInput`` names the key, the value and what is allowed.
        OSError: the folder cannot be written.

    Warns:
        WithoutEffect: of each override that nothing reads, and of a custom feedforward that gave no torque, unless
            ``warn=false`` is one of them.
        OtherModel: of a robot whose model is not the one that results were measured with.
    """
    config_overrides, named = _split(overrides)
    unknown = set(components) - set(COMPONENTS)
    if unknown:
        raise BadInput("run", ", ".join(sorted(unknown)), f"no such component; choose from {', '.join(COMPONENTS)}")
    composed, _ = compose_untyped(config_overrides, config_dir)
    config = to_config(composed)
    targets: dict[str, Any] = {
        key: {"_target_": f"{type(component).__module__}.{type(component).__qualname__}"}
        for key, component in components.items()
    }
    config = replace(config, **targets)
    for text in list_idle_overrides(config, config_overrides, composed):
        warnings.warn(text, WithoutEffect, stacklevel=2)
    if other := describe_other_model(config.machine):
        warnings.warn(other, OtherModel, stacklevel=2)
    place = Path(folder) if folder is not None else named
    if place is None:
        place = Path("outputs", config.scenario, datetime.now().strftime("%Y-%m-%d_%H-%M-%S-%f"))
    result = run_scenario(config, place, prepared=make_scenario(config, None, **components))
    if config.warn and (idle := describe_idle(result)):
        warnings.warn(idle, WithoutEffect, stacklevel=2)
    return result


def open_loop(overrides: str | Sequence[str] = (), *, config_dir: str | Path | None = None) -> OpenLoop:
    """The loop of :func:`run` with these overrides, stepped from outside; nothing is written; raises CmacexpError.

    Whoever steps it takes the place of the feedforward, which overrides do not name. Without torque it gives the bits
    of ``feedforward=none``.
    """
    own, _ = _split(overrides)
    for text in own:
        if text.partition("=")[0].partition(".")[0].lstrip("+~") == "feedforward":
            raise BadInput("overrides", text, "the loop has no feedforward: whoever steps it gives the torque")
    composed, _ = compose_untyped([*own, "feedforward=none"], config_dir)
    config = to_config(composed)
    for text in list_idle_overrides(config, own, composed):
        warnings.warn(text, WithoutEffect, stacklevel=2)
    if other := describe_other_model(config.machine):
        warnings.warn(other, OtherModel, stacklevel=2)
    announce_compiling()
    scenario = make_scenario(config)
    expect_steps(math.inf)
    return OpenLoop(scenario)


def load(folder: str | Path) -> Run:
    """An earlier run, by its folder.

    Raises:
        BadRun: it is not the folder of a run that has ended.
    """
    stored = Run(Path(folder))
    _ = stored.manifest
    return stored
