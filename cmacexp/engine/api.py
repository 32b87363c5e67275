"""Runs from Python, as from the command line: ``run`` one, ``load`` an old one, ``open_loop`` to step one."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, Never

from cmacexp.config import Config, to_config
from cmacexp.config.component import require_shipped
from cmacexp.config.compose import compose_untyped, list_texts, refuse_options
from cmacexp.config.machine import describe_other_model
from cmacexp.data.run import Run as Run
from cmacexp.engine.run import run_scenario
from cmacexp.engine.without_effect import list_idle_overrides
from cmacexp.errors import BadInput, OtherModel, SmallMargin, WithoutEffect
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.stepwise import OpenLoop
from cmacexp.protocols import Controller, Feedforward, Plant, Sensors
from cmacexp.terminal.messages import announce_compiling, describe_idle

RUN_FOLDER = "hydra.run.dir="


def _split(overrides: str | Sequence[str]) -> tuple[list[str], Path | None]:
    """Split overrides into those of the config and the folder that ``hydra.run.dir`` names."""
    if isinstance(overrides, str):
        if len(words := overrides.split()) > 1:
            raise BadInput("overrides", overrides, f"must be a list: {words}")
        overrides = words
    texts = list_texts(overrides)
    folders = [text for text in texts if text.startswith(RUN_FOLDER)]
    others = [text for text in texts if text not in folders]
    refuse_options(others)
    return others, Path(folders[-1].removeprefix(RUN_FOLDER)) if folders else None


def _compose(
    overrides: Sequence[str], config_dir: str | Path | None = None, **targets: Any
) -> tuple[Config, list[str]]:
    """Compose the config of overrides with the given component ``targets``, and list overrides without effect."""
    composed, _ = compose_untyped(overrides, config_dir)
    config = replace(to_config(composed), **targets)
    return config, list_idle_overrides(config, overrides, composed)


def _warn(config: Config, idle: Sequence[str]) -> None:
    """Issue warnings attributed to the caller of ``run`` (stacklevel=3): idle overrides, another robot model."""
    for text in idle:
        warnings.warn(text, WithoutEffect, stacklevel=3)
    if other := describe_other_model(config.machine):
        warnings.warn(other, OtherModel, stacklevel=3)


def run(
    overrides: str | Sequence[str] | Mapping[str, Any] = (),
    folder: str | Path | None = None,
    *,
    config_dir: str | Path | None = None,
    plant: Plant | None = None,
    sensors: Sensors | None = None,
    controller: Controller | None = None,
    feedforward: Feedforward | None = None,
    trust: bool = False,
    **other: Never,
) -> Run:
    """Run the same as ``python -m cmacexp`` with these overrides.

    Args:
        overrides: as typed on the command line, e.g. ``["scenario=one_leg", "cycles=3"]``; a string is one of them.
            Or a whole config, such as that of another run: ``cmacexp.run(cmacexp.load(DIR).config)``.
        folder: of the run; None: ``outputs/<scenario>/<date and time>``, as on the command line.
        config_dir: a folder of custom configs, as ``--config-dir``.
        plant: an object to use instead of the plant that the config names; likewise ``sensors``, ``controller`` and
            ``feedforward``.
        trust: whether a whole config may name components outside this package. Their modules are imported, which
            runs their code: look at each ``_target_`` in a stranger's ``manifest.json`` first.
        other: not taken; what is given by such a name is an override.

    Returns:
        The run; its ``status`` says how it ended.

    Raises:
        CmacexpError: it cannot be run; a ``BadInput`` names the key, the value and what is allowed.
        OSError: the folder cannot be written.

    Warns:
        WithoutEffect: of each override that nothing reads, and of a custom feedforward that gave no torque, unless
            ``warn=false`` is one of them.
        OtherModel: of a robot whose model is not the one that results were measured with.
        SmallMargin: of a robot that may fall, with small margins of delay, torque or roll; not with ``warn=false``.
    """
    for key in other:
        raise BadInput("run", key, f'no such argument; overrides are texts: cmacexp.run(["{key}=..."])')
    given = {"plant": plant, "sensors": sensors, "controller": controller, "feedforward": feedforward}
    components: dict[str, Any] = {key: component for key, component in given.items() if component is not None}
    targets: dict[str, Any] = {
        key: {"_target_": f"{type(component).__module__}.{type(component).__qualname__}"}
        for key, component in components.items()
    }
    texts = named = None
    idle = list[str]()
    if not isinstance(overrides, Mapping):
        texts, named = _split(overrides)
        config, idle = _compose(texts, config_dir, **targets)
    elif missing := [key for key in given if key not in overrides]:
        reason = f'is no whole config, without {missing[0]}; overrides are texts: cmacexp.run(["cycles=3"])'
        raise BadInput("overrides", dict(overrides), reason)
    else:
        if not trust:
            require_shipped(overrides, "trust=True")
        config = replace(to_config(overrides), **targets)
    _warn(config, idle)
    by_time = Path("outputs", config.scenario, datetime.now().strftime("%Y-%m-%d_%H-%M-%S-%f"))
    place = named or by_time if folder is None else Path(folder)
    scenario = make_scenario(config, None, **components)
    for text in scenario.warnings:
        warnings.warn(text, SmallMargin, stacklevel=2)
    result = run_scenario(config, place, prepared=scenario, overrides=texts)
    if config.warn and (without_torque := describe_idle(result)):
        warnings.warn(without_torque, WithoutEffect, stacklevel=2)
    return result


def open_loop(overrides: str | Sequence[str] = (), *, config_dir: str | Path | None = None) -> OpenLoop:
    """Make the loop of :func:`run` for stepping from outside; it writes nothing. Raises CmacexpError.

    Whoever steps it takes the place of the feedforward, which overrides do not name. Without torque it gives the bits
    of ``feedforward=none``.
    """
    own, _ = _split(overrides)
    for text in own:
        if text.partition("=")[0].partition(".")[0].lstrip("+~") == "feedforward":
            raise BadInput("overrides", text, "the loop has no feedforward: whoever steps it gives the torque")
    config, idle = _compose([*own, "feedforward=none"], config_dir)
    _warn(config, idle)
    announce_compiling()
    return OpenLoop(make_scenario(config))


def load(folder: str | Path) -> Run:
    """Load an earlier run by its folder.

    Raises:
        BadRun: it is not the folder of a run that has ended.
    """
    stored = Run(Path(folder))
    _ = stored.manifest
    return stored
