"""What is typed and has no effect is warned of, and nothing else: declarations are compared with results.

``CMACEXP_EFFECTS=1`` compares all keys of all these commands, which takes some half an hour.
"""

import os
import random
from functools import cache

import pytest
from support.command import cmacexp as command
from support.fields import leaves

import cmacexp
from cmacexp.config.compose import compose_config, compose_untyped
from cmacexp.config.effect import TERM
from cmacexp.errors import CmacexpError, WithoutEffect
from cmacexp.experiment.without_effect import warnings_of

ALL = "CMACEXP_EFFECTS" in os.environ
SAMPLE = 6
"""Keys that the short form compares."""
LEG = ("scenario=one_leg", "cycles=2", "learning.start_cycle=1", "gait.cycle_time=0.6", "sampling_period=0.01")
DROP = ("scenario=force_step", "gait.cycle_time=0.6", "sampling_period=0.01")
WALK = (
    "scenario=quadruped",
    "cycles=1",
    "learning.start_cycle=1",
    "sampling_period=0.0125",
    "terrain.stiffness=1000",
)
NOISE = (
    "sensors=real",
    "sensors.force.dropout=0.2",
    "sensors.velocity.fault.kind=noise",
    "sensors.velocity.fault.value=1",
)
RULES = ("normalised", "dead_zone", "leakage", "e_modification", "weight_smoothing", "decaying_rate", "zero_phase")
COMMANDS = (
    LEG,
    DROP,
    (*DROP, "force_control=explicit"),
    *((*LEG, f"feedforward={name}") for name in ("none", "mlp", "ilc", "inverse_dynamics")),
    (*LEG, "feedforward=rbf", "feedforward.centres=40"),
    *((*LEG, f"force_control={name}") for name in ("stiffness", "damping", "explicit")),
    *((*LEG, f"learning.rule={name}") for name in RULES),
    *((*LEG, f"sensors={name}") for name in ("real", "encoders")),
    (*LEG, *NOISE),
    (*LEG, "terrain=patchy"),
    (*LEG, "terrain.step_time=0.3", "terrain.step_factor=0.5"),
    (*LEG, "terrain.slope=0.1"),
    (*LEG, "cmac.addressing=visited"),
    (*LEG, "cmac.layers=1"),
    (*LEG, "plant=mujoco_leg"),
    (*LEG, "learning.start_cycle=3"),
    WALK,
    (*WALK, "payload.weight=3"),
    (*WALK, "machine.weight=null"),
    (*WALK, "plant=mujoco_quadruped", "sampling_period=0.01"),
)
FACTORS = (0.0, 1.01, 1.1, 0.9, 2.0, 0.5, 10.0, 0.1, 1000.0, 1e-3)
NOT_COMPARED = (
    "record",
    "sweep",
    "optimize",
    "warn",
    "scenario",
    "gait.cycle_time",
    "sampling_period",
    "machine.kind",
)


@cache
def results(overrides, folder):
    """Hashes of the files of a run."""
    place = folder / str(len(list(folder.iterdir())))
    return cmacexp.run([*overrides, "record=trace", "warn=false"], place).manifest["files"]


def other_values(value, declared):
    """Other values of a field; some of them may not be allowed."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, list):
        return [[each * 2 if isinstance(each, float) else each for each in value], value[:1]]
    if "choices" in declared:
        return [name for name in declared["choices"] if name != value]
    if isinstance(value, str):
        return []
    scale = value or 1.0
    found = [scale * factor for factor in FACTORS[: None if ALL else 4]] + [scale + 1, 900.0, 0.05]
    return [each for each in map(type(value) if value is not None else float, found) if each != value]


def has_effect(overrides, key, value, declared, folder):
    """Whether another value of a field changes a file of the run; None if none is allowed."""
    found = None
    for other in other_values(value, declared):
        try:
            found = results((*overrides, f"{key}={other}"), folder) != results(overrides, folder)
        except CmacexpError:
            continue
        if found:
            return True
    return found


def warned(overrides):
    composed, _ = compose_untyped(overrides)
    return warnings_of(compose_config(overrides), overrides, composed)


def cases():
    """Commands with keys of theirs."""
    if ALL:
        return [(overrides, None) for overrides in COMMANDS]
    return [(LEG, random.Random(5).sample([key for key, *_ in fields_of(LEG)], SAMPLE))]


def fields_of(overrides):
    return [each for each in leaves(compose_config(overrides)) if not each[0].startswith(NOT_COMPARED)]


@pytest.mark.parametrize(("overrides", "keys"), cases())
def test_a_field_is_warned_of_exactly_if_it_changes_nothing(overrides, keys, tmp_path):
    wrong = []
    for key, value, declared in fields_of(overrides):
        if keys is None or key in keys:
            effect = has_effect(overrides, key, value, declared, tmp_path)
            text = "null" if value is None else str(value)
            warning = warned([*overrides, f"{key}={text}"])[-1:]
            is_own = any(line.startswith(f"{key}=") and "comes after" not in line for line in warning)
            if effect is not None and effect == is_own:
                wrong.append((key, "has an effect" if effect else "has no effect", warning))
    assert not wrong


@pytest.mark.parametrize("scenario", ["one_leg", "force_step", "quadruped", "quadruped_lasting"])
def test_what_is_declared_can_be_read(scenario):
    for key, _, declared in leaves(compose_config([f"scenario={scenario}"])):
        for term in filter(None, declared.get("needs", "").replace(" or ", " and ").split(" and ")):
            assert TERM.fullmatch(term), f"{key}: {term}"
    assert not warned([f"scenario={scenario}"])


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["payload.x=0.1"], ["payload.x=0.1 has no effect: needs payload.weight above 0"]),
        (["payload={x: 0.1}"], ["payload={x: 0.1} has no effect: needs payload.weight above 0"]),
        (["posture.gain=3"], ["posture.gain=3 has no effect: needs machine.kind=quadruped|robot"]),
        (["cycles=3", "cycles=4"], ["cycles=3 has no effect: cycles=4 comes after it"]),
        (
            ["learning.leakage=0.1"],
            ["learning.leakage=0.1 has no effect: needs learning.rule=leakage|zero_phase"],
        ),
        (["learning.rule=leakage", "learning.leakage=0.1"], []),
        (["feedforward=none", "cmac.layers=8"], ["cmac.layers=8 has no effect: needs feedforward=cmac"]),
        (["feedforward=none", "cmac=quadruped"], ["cmac=quadruped has no effect: needs feedforward=cmac"]),
        (["feedforward=none", "seed=1"], ["seed=1 has no effect: needs feedforward=cmac"]),
        (["feedforward=none", "seed=1", "sensors=noisy_force"], []),
        (["feedforward=none", "reference=aware"], []),
        (
            ["cycles=3", "learning.start_cycle=4"],
            ["learning.start_cycle=4 has no effect: needs learning.start_cycle at most cycles"],
        ),
        (
            ["sensors=real", "sensors.force.fault.start=1"],
            ["sensors.force.fault.start=1 has no effect: needs sensors.force.fault.kind!=none"],
        ),
        (["payload.x=0.05", "gait.lift=${payload.x}"], []),
        (["warn=false", "payload.x=0.1"], []),
        (["optimize=force_rmse"], ["optimize=force_rmse has no effect: needs hydra.mode=MULTIRUN"]),
        (["feedforward._target_=cmacexp.loop.external.Mine", "cmac.layers=8"], []),
    ],
)
def test_warnings(overrides, expected):
    if any("Mine" in text for text in overrides):
        overrides = ["feedforward._target_=support.fields.Mine", *overrides[1:]]
    assert warned(overrides) == expected


def test_a_sweep_warns_once_of_what_has_no_effect_in_any_job(tmp_path):
    swept = ("plausibility.enabled=false,true", "plausibility.patience=1,2", "posture.gain=1,2", "seed=1")
    done = command("-m", *DROP, *swept, "hydra.sweep.dir=sweep", folder=tmp_path)
    warnings = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert warnings == [
        "warning: posture.gain has no effect in any job: needs machine.kind=quadruped|robot",
        "warning: seed has no effect in any job: needs feedforward=cmac and learning.start_cycle at most cycles",
    ]


def test_a_run_from_python_warns_as_python_does(tmp_path):
    with pytest.warns(WithoutEffect, match=r"payload\.x=0\.1 has no effect: needs payload\.weight above 0") as caught:
        cmacexp.run([*DROP, "record=trace", "payload.x=0.1"], tmp_path / "run")
    assert caught[0].filename == __file__
