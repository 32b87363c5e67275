"""The reference of force control: what a foot is sent so that it presses with the desired force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from support.doors import make_scenario, roll_out

from cmacexp.planning.reference import ACTING, BEFORE, Gains, compute_support_reference

METHODS = ("stiffness", "damping", "combined", "explicit")
FED = {"damping": "velocity", "explicit": "force"}
"""What a method is fed, if not a depression."""
positive = st.floats(1e-3, 1e3)
gains_of_any_size = st.builds(Gains, *[positive] * 6)


def steady_force(method, fed, gains):
    """Eq. 8, 10, 12, 14: force at rest for the D_r, dY_r or F_r that is fed."""
    position_gain, velocity_gain, force_gain, elasticity, admittance, stiffness = gains
    if method == "stiffness":
        return fed / (1.0 / stiffness + 1.0 / position_gain + elasticity)
    if method == "damping":
        return velocity_gain * fed / (1.0 + velocity_gain * admittance)
    if method == "combined":
        rest = 1.0 + position_gain / stiffness + position_gain * elasticity + velocity_gain * admittance
        return position_gain * fed / rest
    return force_gain * fed / (1.0 + force_gain)


@pytest.mark.parametrize("method", METHODS)
@given(gains=gains_of_any_size, force=positive)
def test_references_invert_the_steady_states_and_lack_one_term_without_static_load(method, gains, force):
    held, dropped = (compute_support_reference(method, gains, keep) for keep in (True, False))
    fed = FED.get(method, "depression")
    assert steady_force(method, force * getattr(held, fed), gains) == pytest.approx(force, rel=1e-12)
    gain = getattr(gains, {"velocity": "velocity_gain", "force": "force_gain"}.get(fed, "position_gain"))
    assert getattr(held, fed) - getattr(dropped, fed) == pytest.approx(1.0 / gain, rel=1e-6, abs=1e-9)
    others = [name for name in held._fields if name != fed]
    assert_allclose([getattr(dropped, name) for name in others], [getattr(held, name) for name in others])


WRONG_GROUND = {"force_control.force_gain": 40, "terrain.stiffness": 20, "terrain.assumed_stiffness": 10}
FIRM = {"controller.position_gain": 150, "controller.velocity_gain": 8, "force_control.elasticity": 0.05,
        "force_control.admittance": 0.2}  # fmt: skip


@pytest.mark.parametrize("changes", [FIRM, WRONG_GROUND, {"reference": "force_feedforward"}], ids=lambda c: min(c))
@pytest.mark.parametrize("method", METHODS)
def test_force_settles_as_desired_or_at_the_steady_state_of_wrong_ground(make_config, method, changes):
    step = ("scenario=force_step", f"force_control={method}", "force_control.desired_force=1.3", "machine.mass=1.0")
    config = make_config(*step, "gait.cycle_time=15", *[f"{key}={value}" for key, value in changes.items()])
    rollout = roll_out(make_scenario(config))
    control, force = config.controller, config.force_control
    (position, velocity, pressed, *_), expected = (values[0, 0, 0] for values in rollout.plan.reference), 1.3
    if changes is WRONG_GROUND:
        fed = {"damping": velocity[1], "explicit": pressed}.get(method, position[1] - config.machine.hip_height)
        gains = (control.position_gain, control.velocity_gain, force.force_gain, force.elasticity, force.admittance)
        expected = steady_force(method, fed, (*gains, config.terrain.stiffness))
    assert_allclose(rollout.columns()["force"][-200:], expected, rtol=1e-3)


@pytest.mark.parametrize(
    ("reference", "before", "acting"),
    [("literal", True, True), ("aware", True, False), ("force_feedforward", False, False)],
)
def test_static_load_is_kept_by_the_rule_of_the_reference(plan_of, reference, before, acting):
    plan = plan_of("scenario=one_leg", f"reference={reference}")
    depth = plan.reference.position[:, plan.support[:, 0], 0, 1] - 0.5
    assert_allclose(depth[BEFORE], 0.215 if before else 0.205)
    assert_allclose(depth[ACTING], 0.215 if acting else 0.205)
    added = plan.force_desired if reference == "force_feedforward" else np.zeros_like(plan.force_desired)
    assert_allclose(plan.reference.force_added, [added, added])
