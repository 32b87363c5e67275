"""Growth per cycle: predicted by the linearised loop, and as it comes."""

import numpy as np
import pytest
from support.robot_walks import ROBOT, SHORT
from support.robots import OWN

from cmacexp.stability.cycle_map import NotPredictable, list_arrays, make_restorable_loop
from cmacexp.stability.growth import change_sizes, fitted_growth, predicted_growth
from cmacexp.stability.krylov import krylov

WINDOW = (40, 140)
"""Changes of these cycles; the paper's law diverges in cycle 169."""


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
    assert np.isnan(fitted_growth([1.0, 2.0]))
    assert np.isnan(fitted_growth([1.0, 0.0, 2.0]))


RUNS = [
    ("scenario=one_leg",),
    ("scenario=one_leg", "learning.rule=zero_phase", "actuator.delay=1", "actuator.rate_limit=5000"),
    ("scenario=one_leg", "feedforward=ilc"),
    ("scenario=one_leg", "sensors=real", "sensors.velocity.delay=2", "sensors.force.dropout=0.1"),
    ("scenario=one_leg", "sensors=real", "sensors.velocity.lag=0.004", "actuator.lag=0.006"),
    ("scenario=force_step",),
    ("scenario=quadruped", "terrain=patchy", "terrain.damping=5", "sensors=noisy_force", "plausibility=force"),
]


@pytest.mark.parametrize("overrides", RUNS, ids=lambda run: " ".join(run))
def test_every_array_that_the_loop_changes_is_declared(make_config, overrides):
    loop = make_restorable_loop(make_config(*overrides, "learning.start_cycle=1"))
    arrays = list_arrays(loop.run.loop)
    before = [each.array.tobytes() for each in arrays]
    assert loop.advance(loop.period)
    changed = {each.name for each, old in zip(arrays, before, strict=True) if each.array.tobytes() != old}
    assert {"plant_state.q", "control_state.error", "plant_state.clock"} <= changed
    assert changed <= {each.name for each in arrays if each.role is not None}


IN_MUJOCO = [
    ("scenario=one_leg", "plant=mujoco_leg"),
    ("scenario=quadruped", "plant=mujoco_quadruped", "sensors=noisy_force"),
    (*ROBOT, f"machine.path={OWN}", *SHORT, "sensors=encoders"),
]


@pytest.mark.parametrize("overrides", RUNS + IN_MUJOCO, ids=lambda run: " ".join(run[:2]))
def test_a_loop_put_back_repeats_itself(make_config, overrides):
    if overrides in IN_MUJOCO:
        pytest.importorskip("mujoco")
    loop = make_restorable_loop(make_config(*overrides, "cycles=9", "learning.start_cycle=1"))
    assert loop.advance(loop.period)
    assert loop.advance(7)  # so that ring buffers do not begin at their first sample
    held, ends = loop.hold(), []
    for _ in range(3):
        loop.put(held)
        assert loop.advance(loop.period)
        ends.append(loop.state())
        assert loop.cycles == 2
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


def test_weights_that_give_no_torque_never_change(make_config):
    """They are eigenvectors of the cycle map with the eigenvalue 1, which changes of a run do not contain."""
    loop = make_restorable_loop(make_config("scenario=one_leg", "learning.lead=1"))
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


@pytest.mark.parametrize("lead", [-1, 0, 1, 2])
def test_growth_is_predicted_from_the_first_cycles(make_config, lead):
    config = make_config("scenario=one_leg", "cycles=200", f"learning.lead={lead}")
    sizes = change_sizes(config, WINDOW[1] + 1)
    first, last = WINDOW if lead >= 0 else (20, len(sizes) - 5)
    measured = fitted_growth(sizes[first - 1 : last])
    growth = predicted_growth(config)
    assert growth.over(first, last) == pytest.approx(measured, abs=0.002)
    assert growth.per_cycle == pytest.approx(measured, abs=0.01)
    assert (growth.per_cycle < 1.0) == (lead == 1)
    assert (abs(growth.krylov.eigenvalues()[0]) < 1.0) == (lead == 1)


def test_growth_of_a_walk_is_predicted(make_config):
    config = make_config("scenario=quadruped", "cycles=200")
    sizes = change_sizes(config, 101)
    assert predicted_growth(config, cycle=40).over(45, 100) == pytest.approx(fitted_growth(sizes[44:100]), abs=0.005)


def test_what_does_not_learn_is_not_predicted(make_config):
    with pytest.raises(NotPredictable, match="nothing learns"):
        predicted_growth(make_config("scenario=one_leg", "feedforward=none", "cycles=200"))
    with pytest.raises(NotPredictable, match="before cycle 60"):
        predicted_growth(make_config("scenario=one_leg", "learning.lead=-2", "cycles=200"), cycle=60)
