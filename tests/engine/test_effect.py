"""What is typed and has no effect is warned of, in a line that names what would make it count."""

from types import SimpleNamespace

import pytest
from support.fields import leaves
from support.rollout import roll_out

import cmacexp
from cmacexp.config.component import COMPONENTS
from cmacexp.config.compose import compose_config, compose_untyped
from cmacexp.config.schema import DRAWS as NEEDS_OF_SEED
from cmacexp.config.schema import MOVES
from cmacexp.errors import WithoutEffect
from cmacexp.experiment.without_effect import _needs as needs_of
from cmacexp.experiment.without_effect import warnings_of
from cmacexp.loop.scenario import make_scenario

DROP = ("scenario=force_step", "gait.cycle_time=0.6", "sampling_period=0.01")


def warned(overrides):
    composed, _ = compose_untyped(overrides)
    return warnings_of(compose_config(overrides), overrides, composed)


CMACS = "needs feedforward in ('cmac', 'cmac_on_model')"


STANDS = MOVES[0].replace("option.", "")
ACTS = "learning.start_cycle <= cycles or learning.start_from is not None"
DRAWS = NEEDS_OF_SEED[0].replace("option.", "")


@pytest.mark.parametrize("scenario", ["one_leg", "force_step", "quadruped", "quadruped_lasting"])
def test_what_is_declared_can_be_evaluated(scenario):
    """A misspelt name would count as met."""
    config = compose_config([f"scenario={scenario}", "sensors=real"])
    names = {**vars(config), "option": SimpleNamespace(**dict.fromkeys(COMPONENTS, "x"))}
    for key, *_ in leaves(config):
        for need in needs_of(config, key):
            eval(need, {}, {**names, "hydra": SimpleNamespace(mode="RUN")})
    assert not warned([f"scenario={scenario}"])


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["payload.x=0.1"], ["payload.x=0.1 has no effect: needs payload.weight > 0"]),
        (
            ["scenario=force_step", "terrain.slope=0.1", "terrain.slope_start=-1"],
            [f"terrain.{key} has no effect: needs {STANDS}" for key in ("slope=0.1", "slope_start=-1")],
        ),
        (["payload={x: 0.1}"], ["payload={x: 0.1} has no effect: needs payload.weight > 0"]),
        (
            ["sensors=noisy_force", "sensors.force.legs=[1]"],
            ["sensors.force.legs=[1] has no effect: needs machine.kind in ('quadruped', 'robot')"],
        ),
        (
            ["scenario=force_step", "feedforward=inverse_dynamics", "feedforward.length_factor=2"],
            ["feedforward.length_factor=2 has no effect: needs machine.kind != 'point_mass'"],
        ),
        (["posture.gain=3"], ["posture.gain=3 has no effect: needs machine.kind in ('quadruped', 'robot')"]),
        (["cycles=3", "cycles=4"], ["cycles=3 has no effect: cycles=4 comes after it"]),
        (
            ["learning.leakage=0.1"],
            ["learning.leakage=0.1 has no effect: needs learning.rule in ('leakage', 'zero_phase')"],
        ),
        (["learning.rule=leakage", "learning.leakage=0.1"], []),
        (
            ["feedforward=none", "cmac.layers=8"],
            [f"cmac.layers=8 has no effect: {CMACS}"],
        ),
        (
            ["feedforward=none", "cmac=quadruped"],
            [f"cmac=quadruped has no effect: {CMACS}"],
        ),
        (["feedforward=none", "seed=1"], [f"seed=1 has no effect: needs {DRAWS}"]),
        (["feedforward=none", "seed=1", "sensors=noisy_force"], []),
        (["feedforward=none", "reference=aware"], []),
        (["cycles=3", "learning.start_cycle=4"], []),
        (["cycles=3", "learning.start_cycle=4", "cmac.layers=8"], [f"cmac.layers=8 has no effect: needs {ACTS}"]),
        (["cycles=1", "learning.rate=0.1"], [f"learning.rate=0.1 has no effect: needs {ACTS}"]),
        (["cycles=1", "learning.start_from=run", "learning.rate=0.1", "learning.guard=freeze", "cmac.layers=8"], []),
        (
            ["learning.start_from=run", "learning.start_cycle=3"],
            ["learning.start_cycle=3 has no effect: needs learning.start_from is None"],
        ),
        (["feedforward=rbf", "learning.guard=freeze", "learning.lead=estimate", "seed=1"], []),
        (
            ["sensors=real", "sensors.force.fault.start=1"],
            ["sensors.force.fault.start=1 has no effect: needs sensors.force.fault.kind != 'none'"],
        ),
        (["payload.x=0.05", "gait.lift=${payload.x}"], []),
        (["warn=false", "payload.x=0.1"], []),
        (["optimize=force_rmse"], ["optimize=force_rmse has no effect: needs hydra.mode == 'MULTIRUN'"]),
        (["feedforward._target_=cmacexp.loop.external.Mine", "cmac.layers=8"], []),
    ],
)
def test_warnings(overrides, expected):
    if any("Mine" in text for text in overrides):
        overrides = ["feedforward._target_=support.fields.Mine", *overrides[1:]]
    assert warned(overrides) == expected


@pytest.mark.parametrize(
    "changed",
    [
        ("cycles=3", "learning.start_cycle=4"),
        ("cycles=1", "learning.start_from='{learnt}'"),
        ("cycles=1", "learning.start_from='{learnt}'", "learning.rate=0.1"),
        ("feedforward=rbf", "learning.guard=freeze", "learning.lead=estimate", "cycles=11", "seed=1"),
    ],
)
def test_nothing_that_changes_a_run_is_said_to_have_no_effect(changed, learnt):
    """The last override changes torques: without it they are others."""
    overrides = ["scenario=one_leg", *(text.format(learnt=learnt) for text in changed)]
    torques = [
        roll_out(make_scenario(compose_config(given))).columns()["tau_feedforward_1"].tobytes()
        for given in (overrides, overrides[:-1])
    ]
    assert torques[0] != torques[1]
    assert not warned(overrides)


@pytest.fixture(scope="module")
def learnt(tmp_path_factory):
    """A run that has learnt."""
    overrides = ["scenario=one_leg", "cycles=3", "record.weights=true", "record=trace"]
    return cmacexp.run(overrides, tmp_path_factory.mktemp("learnt") / "run").folder


def test_a_run_from_python_warns_as_python_does(tmp_path):
    with pytest.warns(WithoutEffect, match=r"payload\.x=0\.1 has no effect: needs payload\.weight > 0") as caught:
        cmacexp.run([*DROP, "record=trace", "payload.x=0.1"], tmp_path / "run")
    assert caught[0].filename == __file__
