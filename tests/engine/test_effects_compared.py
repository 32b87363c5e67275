"""What fields declare to need for an effect is compared with the results of runs.

A field whose need is met must change a trace of the run at some value; those whose need is not met, all changed at
once, must change none. ``CMACEXP_EFFECTS=1`` compares all fields of all these commands, which
takes some 10 minutes.
"""

import copy
import itertools
import os
import random

import pytest
from support.fields import leaves

from cmacexp.cmac.rules import RULES, strength_needs
from cmacexp.config.check import check
from cmacexp.config.compose import compose_config, compose_untyped
from cmacexp.data.tables import BODY, TRACE
from cmacexp.errors import BadInput, CmacexpError
from cmacexp.experiment.run import run_scenario
from cmacexp.experiment.without_effect import explain_idle, warnings_of

ALL = "CMACEXP_EFFECTS" in os.environ
SAMPLE = 8
"""Fields with an effect that the short form compares, of each of its commands."""
LEG = ("scenario=one_leg", "cycles=2", "learning.start_cycle=1", "gait.cycle_time=0.6", "sampling_period=0.01")
DROP = ("scenario=force_step", "gait.cycle_time=0.6", "sampling_period=0.01")
MUJOCO_WALK = (
    "scenario=quadruped",
    "plant=mujoco_quadruped",
    "cycles=1",
    "learning.start_cycle=1",
    "gait.cycle_time=0.6",
)
"""With the sampling period of its option: with a longer one it diverges within a few steps."""
BESIDE = ("sensors=real", "sensors.position.bias=0.001", "sensors.velocity.bias=0.001")
"""A mass that seems to be beside its path, which without errors of its position leaves gains without effect."""
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
FAULTS = [
    ("sensors=real", *(f"sensors.{signal}.fault.{each}" for each in (f"kind={kind}", f"value={value}", "start=0.2")))
    for signal, kind, value in (("position", "last", 0), ("velocity", "value", 0.1), ("force", "bias", 0.3))
]
FEW_CELLS = ("cmac.inputs=[angle]", "cmac.layers=4", "cmac.resolution_elements=4", "cmac.memory_bytes=1024")
WATCHED = ("plausibility=force", "plausibility.relative_tolerance=0.3")
"""Narrow enough to exclude a sensor."""
WEIGHTS = "learning.start_from=weights"
SHORT = (LEG, (*DROP, "sensors=real", "sensors.force.bias=0.6", "sensors.force.start=0.4", *WATCHED), WALK)
"""Commands of the short form."""
COMMANDS = (
    *SHORT,
    DROP,
    *((*DROP, *BESIDE, f"force_control={name}") for name in ("stiffness", "damping", "explicit")),
    *((*DROP, "cmac=one_leg", f"feedforward={name}") for name in ("cmac", "inverse_dynamics")),
    *((*LEG, f"feedforward={name}") for name in ("none", "ilc", "inverse_dynamics")),
    (*LEG, "feedforward=rbf", "feedforward.centres=40"),
    (*LEG, "feedforward=none", *NOISE),
    *((*LEG, f"force_control={name}") for name in ("stiffness", "damping", "explicit")),
    *((*LEG, f"learning.rule={name}") for name in RULES if name != "paper"),
    *((*LEG, f"reference={name}") for name in ("aware", "force_feedforward")),
    *((*LEG, f"sensors={name}") for name in ("real", "encoders", "noisy_force")),
    (*LEG, "sensors=force_stuck", "sensors.force.fault.start=0.2", "plausibility=force"),
    *((*LEG, *fault) for fault in FAULTS),
    (*LEG, *NOISE),
    (*LEG, "actuator.torque_limit=0.5", "actuator.rate_limit=20", "actuator.delay=1", "actuator.lag=0.01"),
    (*LEG, "terrain=patchy"),
    (*LEG, "terrain.damping=1"),
    (*LEG, "terrain.step_time=0.3", "terrain.step_factor=0.5"),
    (*LEG, "terrain.slope=0.1"),
    (*LEG, "cmac.addressing=visited"),
    (*LEG, *FEW_CELLS, "cmac.addressing=dense"),
    (*LEG, "cmac.receptive_field=linear"),
    (*LEG, "cmac.layers=1", "cmac.memory_bytes=256"),
    (*LEG, "plant=mujoco_leg"),
    (*LEG, "learning.start_cycle=3"),
    (*LEG, WEIGHTS),
    (*LEG, "learning=lasting"),
    (*WALK, "payload.weight=3"),
    (*WALK, "machine.weight=null"),
    (*WALK, "force_control.load_sharing=dynamic", "machine.weight=null"),
    (*WALK, "posture.gain=0"),
    (*WALK, "feedforward=none", "sensors=real", "sensors.tilt.noise=0.01"),
    (*WALK, "terrain.slope=0.02"),
    (*WALK, "terrain.step_time=0.3", "terrain.step_factor=0.8"),
    MUJOCO_WALK,
    (*MUJOCO_WALK, "payload.weight=3", "plant.start_spread=0.01"),
)
FACTORS = (1.1, 0.0, 2.0, 0.5, 1.01, 0.9, 10.0, 0.1, 1000.0, 1e-3)
LISTS = ([1], [2], [2, 3], [0.3], [0.0, 0.5, 0.85, 0.35], ["velocity"])
ROUNDS = 4 if ALL else 2
"""How often the fields without effect are changed, to other values each time."""
LIMIT = "cmac.memory_bytes"
"""A limit alone, unless cells are hashed to it: too low a value is refused, any other gives the same run."""
INTERPOLATED = "machine.leg."
"""Fields that others take their values from."""
NOT_COMPARED = (
    "record",
    "sweep",
    "optimize",
    "warn",
    "scenario",
    "cycles",
    "gait.cycle_time",
    "sampling_period",
    "machine.kind",
)


class Command:
    """A command line with its config and its results."""

    def __init__(self, overrides, folder):
        self.folder, self.weights = folder, folder / "weights"
        if WEIGHTS in overrides:
            kept = compose_config([*LEG, "record=trace", "record.weights=true"])
            run_scenario(kept, self.weights)
        overrides = [text.replace(WEIGHTS, f"learning.start_from={self.weights}") for text in overrides]
        self.overrides = [*overrides, "record=trace"]
        self.composed, _ = compose_untyped(self.overrides)
        self.config = compose_config(self.overrides)
        self.fields = [each for each in leaves(self.config) if not each[0].startswith(NOT_COMPARED)]
        if self.config.cmac.addressing != "hashed":
            self.fields = [each for each in self.fields if each[0] != LIMIT]
        typed = {key: f"{key}={'null' if value is None else value}" for key, value, _ in self.fields}
        lines = warnings_of(self.config, list(typed.values()), self.composed)
        self.idle = {key for key in typed if any(line.startswith(f"{key}=") for line in lines)}
        self.numbers = itertools.count()
        self.files = self.results(self.config)

    def results(self, config):
        """Hashes of the traces of a run: all else follows from them, or says how large the memory of a network is."""
        files = run_scenario(config, self.folder / str(next(self.numbers))).manifest["files"]
        return {name: value for name, value in files.items() if name in (TRACE, BODY)}

    def other_values(self, key, value, declared):
        """Other values of a field; some of them may not be allowed."""
        if key == "learning.rule":
            return [name for name in RULES if name != value]
        if key == "learning.start_from":
            return [str(self.weights)] if value is None else [None]
        if isinstance(value, bool):
            return [not value]
        if isinstance(value, list):
            doubled = [each * 2 if isinstance(each, float) else each for each in value]
            return [each for each in (doubled, value[:1], *LISTS, None) if each != value]
        if "choices" in declared:
            return [name for name in declared["choices"] if name != value]
        if isinstance(value, str):
            return [0, 1, 2]
        kind = float if value is None else type(value)
        found = [kind((value or 1.0) * factor) for factor in FACTORS] + [
            kind((value or 0) + 1),
            kind(900),
            kind(0.05),
        ]
        return [each for each in dict.fromkeys(found) if each != value] + (list(LISTS) if value is None else [])

    def config_with(self, key, value):
        """The config with another value of one field, before it is checked."""
        if key.startswith(INTERPOLATED):
            return compose_config([*self.overrides, f"{key}={value}"])
        config = copy.deepcopy(self.config)
        set_value(config, key, value)
        return config

    def changes(self, key, value, declared):
        """Whether some value of a field changes a trace; None if no other is allowed."""
        allowed = False
        for other in self.other_values(key, value, declared):
            try:
                check(config := self.config_with(key, other))
                if self.results(config) != self.files:
                    return True
                allowed = True
            except CmacexpError:
                continue
        return False if allowed else None

    def idle_changed(self, keys, number):
        """Which of some fields without effect were changed at once, and the traces then.

        Each has another value that is allowed, the search for which begins at ``number``.
        """
        config, changed = copy.deepcopy(self.config), []
        for key, value, declared in self.fields:
            others = self.other_values(key, value, declared) if key in keys else []
            for other in (*others[number:], *others[:number]):
                set_value(config, key, other)
                try:
                    check(config)
                except CmacexpError:
                    set_value(config, key, value)
                    continue
                changed.append(key)
                break
        together = [key for key in changed if not explain_idle(config, key, strength_needs(key))]
        if together:  # such as time and factor of a step
            return self.idle_changed([key for key in keys if key != together[-1]], number)
        try:
            return changed, self.results(config)
        except BadInput as error:
            allowed = [key for key in changed if key not in str(error)]
            if allowed == changed:
                raise
            return self.idle_changed(allowed, number)


def set_value(config, key, value):
    """Set one field of a config."""
    *parents, name = key.split(".")
    for parent in parents:
        config = getattr(config, parent)
    setattr(config, name, value)


@pytest.fixture(params=COMMANDS if ALL else SHORT, ids=" ".join)
def command(request, tmp_path):
    return Command(request.param, tmp_path)


def test_a_field_that_is_not_warned_of_has_an_effect(command):
    fields = [each for each in command.fields if each[0] not in command.idle]
    if not ALL:
        fields = random.Random(5).sample(fields, SAMPLE)
    assert not [key for key, value, declared in fields if command.changes(key, value, declared) is False]


def test_fields_that_are_warned_of_have_no_effect(command):
    assert command.idle
    for number in range(ROUNDS):
        changed, files = command.idle_changed(command.idle, number)
        assert changed
        if files != command.files:
            found = [key for key in changed if command.idle_changed([key], number)[1] != command.files]
            pytest.fail(f"have an effect: {found or changed}")
