"""What fields declare to need for an effect is compared with the results of runs.

A field whose need is met must change a trace of the run at some value; those whose need is not met, all changed at
once, must change none.
"""

import itertools
import random
from contextlib import suppress

import pytest
from support.doors import RULES, BadInput, CmacexpError, compose_config, compose_untyped, run_scenario
from support.fields import leaves

from cmacexp.experiment.without_effect import warnings_of

SAMPLE = 6
"""Fields with an effect that CI compares, of each of its commands."""
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
SHORT = (LEG, WALK)
"""Commands of which CI tries some fields."""
COMMANDS = (
    *SHORT,
    DROP,
    (*DROP, "sensors=real", "sensors.force.bias=0.6", "sensors.force.start=0.4", *WATCHED),
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
ROUNDS = 4
"""How often the fields without effect are changed, to other values each time."""
LIMIT = "cmac.memory_bytes"
"""A limit alone, unless cells are hashed to it: too low a value is refused, any other gives the same run."""
NOT_COMPARED = (
    *("record", "sweep", "optimize", "warn", "scenario", "cycles", "gait.cycle_time", "sampling_period"),
    *("machine.kind", "gait.speed", "force_control.load_rate"),
)
"""Needs of the last two are not declared yet: standing machines have no speed, explicit force control none."""


def typed(key, value):
    return f"{key}={'null' if value is None else value}"


class Command:
    """A command line with its config and its results."""

    def __init__(self, overrides, folder):
        self.folder, self.weights, self.numbers = folder, folder / "weights", itertools.count()
        if WEIGHTS in overrides:
            run_scenario(compose_config([*LEG, "record=trace", "record.weights=true"]), self.weights)
        overrides = [text.replace(WEIGHTS, f"learning.start_from={self.weights}") for text in overrides]
        self.overrides = [*overrides, "record=trace"]
        config = compose_config(self.overrides)
        not_compared = NOT_COMPARED if config.cmac.addressing == "hashed" else (*NOT_COMPARED, LIMIT)
        self.fields = [each for each in leaves(config) if not each[0].startswith(not_compared)]
        self.idle = self.find_idle([], [typed(key, value) for key, value, _ in self.fields])
        self.files = self.results([])

    def find_idle(self, more, texts):
        """Keys of those of some overrides that are said to have no effect beside ``more``."""
        overrides = [*self.overrides, *more]
        lines = warnings_of(compose_config(overrides), texts, compose_untyped(overrides)[0])
        return {line.partition("=")[0] for line in lines}

    def results(self, more):
        """Hashes of the traces of a run: all else follows from them, or says how large the memory of a network is."""
        run = run_scenario(compose_config([*self.overrides, *more]), self.folder / str(next(self.numbers)))
        return {name: run.manifest["files"].get(name) for name in ("trace.parquet", "body.parquet")}

    def other_values(self, key, value, declared):
        """Other values of a field; some of them may not be allowed."""
        known = {"learning.start_from": [self.weights, None], "learning.rule": RULES}
        if key in known or isinstance(value, bool | str):
            found = known.get(key) or declared.get("choices", (True, False, 0, 1, 2))
        elif isinstance(value, list):
            found = [[each * 2 if isinstance(each, float) else each for each in value], value[:1], *LISTS, None]
        else:
            kind = float if value is None else type(value)
            found = [kind((value or 1.0) * factor) for factor in FACTORS] + [kind((value or 0) + 1), kind(900)]
            found += [kind(0.05), *(LISTS if value is None else ())]
        return [typed(key, each) for each in found if each != value]

    def changes(self, *field):
        """Whether some value of a field changes a trace; None if no other is allowed."""
        allowed = None
        for other in self.other_values(*field):
            try:
                if self.results([other]) != self.files:
                    return True
                allowed = False
            except CmacexpError:
                continue
        return allowed

    def choose(self, number, *field):
        """Another value of a field that is allowed, if there is one, the search for which begins at ``number``."""
        others = self.other_values(*field)
        for other in (*others[number:], *others[:number]):
            with suppress(CmacexpError):
                compose_config([*self.overrides, other])
                return other
        return None

    def idle_changed(self, keys, number):
        """Which of some fields without effect were changed at once, and the traces then."""
        chosen = {field[0]: self.choose(number, *field) for field in self.fields if field[0] in keys}
        changed = {key: text for key, text in chosen.items() if text}
        while True:
            texts = list(changed.values())
            try:
                together = changed.keys() - self.find_idle(texts, texts)  # such as time and factor of a step
                if not together:
                    return changed, self.results(texts)
                del changed[max(together)]
            except BadInput as error:
                del changed[max(key for key in changed if key in str(error))]


TRIED = [pytest.param(each, SAMPLE, 1, marks=pytest.mark.ci, id=" ".join(each)) for each in SHORT]
TRIED += [pytest.param(each, None, ROUNDS, marks=pytest.mark.nightly, id=" ".join(each)) for each in COMMANDS]


@pytest.mark.parametrize(("overrides", "sample", "rounds"), TRIED)
def test_fields_have_an_effect_unless_they_are_warned_of(tmp_path, overrides, sample, rounds):
    command = Command(overrides, tmp_path)
    fields = [each for each in command.fields if each[0] not in command.idle]
    fields = random.Random(5).sample(fields, sample or len(fields))
    assert not [each[0] for each in fields if command.changes(*each) is False]
    assert command.idle
    for number in range(rounds):
        changed, files = command.idle_changed(command.idle, number)
        assert changed
        assert files == command.files, f"some have an effect: {changed}"
