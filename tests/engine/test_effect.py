"""What is typed and has no effect is warned of, in a line that names what would make it count."""

from types import SimpleNamespace

import pytest
from support.doors import compose_config, compose_untyped, make_scenario, roll_out
from support.fields import leaves

import cmacexp
from cmacexp.engine import without_effect
from cmacexp.errors import WithoutEffect

SHORT = ("gait.cycle_time=0.6", "sampling_period=0.01")


def warned(overrides):
    """The overrides that are warned of."""
    composed, _ = compose_untyped(overrides)
    lines = without_effect.list_idle_overrides(compose_config(overrides), overrides, composed)
    return [line.partition(" has no effect: ")[0] for line in lines]


@pytest.mark.parametrize("scenario", ["one_leg", "one_leg_lasting", "force_step", "quadruped", "quadruped_lasting"])
def test_what_is_declared_can_be_evaluated(scenario):
    """A misspelt name would count as met."""
    config = compose_config([f"scenario={scenario}", "sensors=real"])
    options = SimpleNamespace(plant="x", sensors="x", controller="x", feedforward="x")
    names = {**vars(config), "option": options, "hydra": SimpleNamespace(mode="RUN")}
    for key, *_ in leaves(config):
        for need in without_effect._needs(config, key):
            eval(need, {}, names)
    assert not warned([f"scenario={scenario}"])


IDLE = [
    ([], ["payload.x=0.1"]),
    (["scenario=force_step"], ["terrain.slope=0.1", "terrain.slope_start=-1"]),
    ([], ["payload={x: 0.1}"]),
    (["sensors=noisy_force"], ["sensors.force.legs=[1]"]),
    (["scenario=force_step", "feedforward=inverse_dynamics"], ["feedforward.length_factor=2"]),
    ([], ["posture.gain=3"]),
    (["force_control=explicit"], ["force_control.load_rate=true"]),
    (["cycles=4"], ["learning.leakage=0.1"]),
    (["learning.rule=leakage", "learning.leakage=0.1"], []),
    (["feedforward=none"], ["cmac.layers=8", "cmac=quadruped", "seed=1"]),
    (["feedforward=none", "seed=1", "sensors=noisy_force", "reference=aware"], []),
    (["cycles=3", "learning.start_cycle=4"], ["cmac.layers=8"]),
    (["cycles=1"], ["learning.rate=0.1"]),
    (["cycles=1", "learning.start_from=run", "learning.rate=0.1", "cmac.layers=8"], ["learning.start_cycle=3"]),
    (["feedforward=rbf", "learning.guard=freeze", "learning.lead=estimate", "seed=1"], []),
    (["sensors=real"], ["sensors.force.fault.start=1"]),
    (["payload.x=0.05", "gait.lift=${payload.x}"], []),
    (["warn=false", "payload.x=0.1"], []),
    ([], ["optimize=force_rmse"]),
    (["feedforward._target_=support.fields.Mine", "cmac.layers=8"], []),
]


@pytest.mark.parametrize(("effective", "idle"), IDLE)
def test_what_has_no_effect_is_warned_of_and_nothing_else(effective, idle):
    assert warned([*effective, *idle]) == idle


def test_the_first_of_two_that_set_the_same_is_warned_of():
    assert warned(["cycles=3", "cycles=4"]) == ["cycles=3"]


@pytest.mark.parametrize(
    "changed",
    [
        (*SHORT, "cycles=3", "learning.start_cycle=4"),
        ("cycles=1", "learning.start_from='{learnt}'"),
        ("cycles=1", "learning.start_from='{learnt}'", "learning.rate=0.1"),
        (
            *SHORT,
            "feedforward=rbf",
            "feedforward.centres=40",
            "learning.guard=freeze",
            "learning.lead=estimate",
            "cycles=11",
            "seed=1",
        ),
    ],
)
def test_nothing_that_changes_a_run_is_said_to_have_no_effect(changed, stored):
    """The last override changes torques: without it they are others."""
    learnt = stored("scenario=one_leg", "cycles=3", "record.weights=true").folder
    overrides = ["scenario=one_leg", *(text.format(learnt=learnt) for text in changed)]
    torques = [
        roll_out(make_scenario(compose_config(given))).columns()["tau_feedforward_1"].tobytes()
        for given in (overrides, overrides[:-1])
    ]
    assert torques[0] != torques[1]
    assert not warned(overrides)


def test_a_run_from_python_warns_as_python_does_and_says_what_is_needed(tmp_path):
    with pytest.warns(WithoutEffect, match=r"payload\.x=0\.1 .*payload\.weight > 0") as caught:
        cmacexp.run(["scenario=force_step", *SHORT, "record=trace", "payload.x=0.1"], tmp_path / "run")
    assert caught[0].filename == __file__
