"""Growth per cycle: predicted by the linearised loop, and as it comes; and the verdict on learning."""

import math

import numpy as np
import pytest
from support.robots import OWN, ROBOT, SHORT

import cmacexp
from cmacexp.addons.stability.cycle_map import NotPredictable, list_arrays, make_restorable_loop
from cmacexp.addons.stability.growth import change_sizes, fitted_growth, krylov, predicted_growth
from cmacexp.addons.stability.verdict import GROWS, HOLDS, TREND_WINDOW, UNDECIDED, assess, compute_rise


def test_a_known_map_has_its_eigenvalues_and_images():
    matrix = np.diag([1.1, 0.5, -0.9, 0.2])
    matrix[0, 1] = 3.0
    start = np.array([0.1, 1.0, 1.0, 1.0])
    found = krylov(lambda v: (matrix @ v, 2.0 * v), start, 10)
    assert len(found.hessenberg) == 4
    np.testing.assert_allclose(found.eigenvalues(), [1.1, -0.9, 0.5, 0.2], atol=1e-9)
    images = [2.0 * np.linalg.matrix_power(matrix, k) @ start for k in range(7)]
    np.testing.assert_allclose(found.lengths(7), np.linalg.norm(images, axis=1), atol=1e-9)


def test_fitted_growth_is_that_of_a_geometric_series():
    assert fitted_growth(3.0 * 1.02 ** np.arange(50)) == pytest.approx(1.02)
    assert np.isnan([fitted_growth([1.0, 2.0]), fitted_growth([1.0, 0.0, 2.0])]).all()


LEG = ("scenario=one_leg", "gait.cycle_time=0.6", "gait.lift=0.02")
RUNS = {
    "one leg": LEG,
    "late": (*LEG, "learning.rule=zero_phase", "actuator.delay=1", "actuator.rate_limit=5000"),
    "ilc": (*LEG, "feedforward=ilc"),
    "sensors": (*LEG, "sensors=real", "sensors.velocity.delay=2", "sensors.force.dropout=0.1"),
    "lagging": (*LEG, "sensors=real", "sensors.velocity.lag=0.004", "actuator.lag=0.006"),
    "a mass": ("scenario=force_step",),
    "walk": (
        "scenario=quadruped",
        "terrain=patchy",
        "terrain.damping=5",
        "sensors=noisy_force",
        "plausibility=force",
    ),
    "leg in MuJoCo": (*LEG, "plant=mujoco_leg"),
    "walk in MuJoCo": ("scenario=quadruped", "plant=mujoco_quadruped", "sensors=noisy_force"),
    "robot": (*ROBOT, f"machine.path={OWN}", *SHORT, "sensors=encoders"),
    "robot by itself": (*ROBOT, f"machine.path={OWN}", *SHORT, "sensors=proprioceptive"),
}


@pytest.mark.ci
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.nightly] * (" in MuJoCo" in name)) for name in RUNS]
)
def test_every_array_that_a_loop_changes_is_declared_and_put_back_it_repeats_itself(make_config, name):
    loop = make_restorable_loop(make_config(*RUNS[name], "cycles=9", "learning.start_cycle=1"))
    arrays = list_arrays(loop.run.loop)
    before = [each.array.tobytes() for each in arrays]
    assert loop.advance(loop.period)
    if loop.plant is None:
        changed = {each.name for each, old in zip(arrays, before, strict=True) if each.array.tobytes() != old}
        assert {"plant.state.q", "controller.state.error", "plant.state.clock"} <= changed
        assert changed <= {each.name for each in arrays if each.role is not None}
    assert loop.advance(7)  # so that ring buffers do not begin at their first sample
    held, ends = loop.hold(), []
    for _ in range(2):
        loop.put(held)
        assert loop.advance(loop.period)
        ends.append(loop.state())
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.ci
def test_weights_that_give_no_torque_never_change(make_config):
    """They are eigenvectors of the cycle map with the eigenvalue 1, which changes of a run do not contain."""
    loop = make_restorable_loop(make_config(*LEG, "learning.lead=1"))
    assert loop.advance(loop.period)
    params = loop.run.loop.feedforward
    rows = params.log.rows[0, : params.log.used[0]]
    active = (params.cells[:, 0, :, None] == rows).sum(axis=1).astype(float)  # (N, rows): A
    random = np.random.default_rng(0).standard_normal((len(rows), loop.joints))
    without_torque = random - np.linalg.lstsq(active, active @ random)[0]
    now, along = loop.hold(), np.zeros(len(loop.state()))
    along[-without_torque.size :] = without_torque.ravel()
    image, feedback = loop.derivative(now, along, lambda: loop.column("tau_feedback"), loop.period)
    np.testing.assert_allclose(image, along, atol=1e-5)
    np.testing.assert_allclose(feedback, 0.0, atol=1e-5)


@pytest.mark.ci
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(
    ("overrides", "cycle", "window", "tolerance"),
    [
        (("learning.lead=0",), None, (40, 140), 0.002),  # the paper's law diverges in cycle 169
        (("learning.lead=1",), None, (40, 140), 0.002),
        pytest.param(("learning.lead=2",), None, (40, 140), 0.002, marks=pytest.mark.nightly),
        pytest.param(("scenario=quadruped",), 40, (45, 100), 0.005, marks=pytest.mark.nightly),
    ],
)
def test_growth_is_predicted_from_the_first_cycles(make_config, overrides, cycle, window, tolerance):
    config = make_config(*overrides, "cycles=200")
    measured = fitted_growth(change_sizes(config, window[1] + 1)[window[0] - 1 : window[1]])
    growth = predicted_growth(config, cycle)
    assert growth.over(*window) == pytest.approx(measured, abs=tolerance)
    if cycle is None:
        assert growth.per_cycle == pytest.approx(measured, abs=0.01)
        holds = config.learning.lead == 1
        assert (growth.per_cycle < 1.0) == (abs(growth.krylov.eigenvalues()[0]) < 1.0) == holds


@pytest.mark.ci
@pytest.mark.parametrize(("setting", "cycle"), [("feedforward=none", None), ("learning.lead=-2", 60)])
def test_what_does_not_learn_or_ends_before_is_not_predicted(make_config, setting, cycle):
    with pytest.raises(NotPredictable):
        predicted_growth(make_config("scenario=one_leg", setting, "cycles=200"), cycle)


# Verdict


@pytest.mark.ci
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(
    ("settings", "expected", "grows"),
    [
        (("learning.lead=0",), GROWS, True),
        (("learning.lead=1",), HOLDS, False),
        (("learning.rate=1.9", "learning.lead=-2"), GROWS, None),  # fails at once
        (("feedforward=none",), UNDECIDED, None),
        (("terrain.step_time=9", "terrain.step_factor=1000"), UNDECIDED, None),  # fails with feedback only too
        (("sensors=encoders", "learning.lead=2"), UNDECIDED, None),  # cannot be linearised
        pytest.param(("scenario=quadruped", "learning.lead=1"), GROWS, True, marks=pytest.mark.nightly),
    ],
    ids=str,
)
def test_learning_holds_with_lead_one_and_what_is_not_known_is_undecided(make_config, settings, expected, grows):
    verdict = assess(make_config(*settings))
    assert verdict.verdict == expected
    assert verdict.reasons
    assert math.isnan(verdict.growth) if grows is None else (verdict.growth > 1.0) == grows


@pytest.mark.ci
@pytest.mark.usefixtures("compiled")
def test_the_guard_hides_no_growth(make_config):
    settings = ("learning.lead=0", "learning.rate=0.1", "gait.cycle_time=0.6", "gait.lift=0.02")
    plain, guarded = (make_config(*settings, f"learning.guard={guard}") for guard in ("none", "freeze"))
    assert assess(guarded, simulate=False) == assess(plain, simulate=False)


@pytest.mark.ci
@pytest.mark.usefixtures("compiled")
def test_a_run_that_starts_from_weights_ends_by_its_learning_not_with_feedback_only(make_config, tmp_path):
    cmacexp.run(["scenario=one_leg", "cycles=3", "record.weights=true"], folder=tmp_path / "r")
    config = make_config("learning.rate=0.2", "learning.lead=-6", f"learning.start_from={tmp_path / 'r'}")
    assert assess(config).verdict == GROWS


def test_a_rise_is_that_over_the_lowest_level_of_the_cycles_given():
    levels = np.repeat([4.0, 1.0, 2.0], TREND_WINDOW)
    assert compute_rise(levels) == (2.0, 1.0)
    assert compute_rise(levels[:-TREND_WINDOW]) == (1.0, 1.0)
    assert compute_rise(np.append(1000.0, levels))[1] == 10.0  # what is below a hundredth of the highest does no harm
