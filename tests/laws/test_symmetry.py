"""A mirrored gait or machine gives the mirrored walk."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import make_scenario, roll_out

GAIT = "gait.touch_down=[0.5, 0.0, 0.3, 0.8]"
OTHER_SIDE = [1, 0, 3, 2]
HEAVY = ("machine.legs.left_front.mass_1=0.7", "machine.legs.left_rear.length_2=0.37")


@pytest.mark.parametrize(
    "overrides",
    [
        ("cycles=1", "gait.cycle_time=1.0", "gait.load_ramp=0.05", *HEAVY),
        pytest.param(("feedforward=none", "cycles=1"), marks=pytest.mark.ci),
        pytest.param(("cycles=2", *HEAVY), marks=pytest.mark.ci),
        pytest.param(("cycles=8",), marks=pytest.mark.ci),
        pytest.param(("cycles=4", "reference=literal"), marks=pytest.mark.nightly),
        pytest.param(("cycles=4", "posture.gain=4"), marks=pytest.mark.nightly),
    ],
    ids=" ".join,
)
def test_a_mirrored_gait_and_machine_give_the_mirrored_walk(make_config, overrides):
    """Also of what the CMACs learn: all have the same hash, and joint angles do not know left from right."""
    mirrored = [override.replace("left", "right") for override in overrides]
    one, other = (
        roll_out(make_scenario(make_config("scenario=quadruped", *own))) for own in (overrides, (*mirrored, GAIT))
    )
    assert (one.status, len(one.samples)) == (other.status, len(other.samples))
    assert_allclose(other.samples, one.samples[:, OTHER_SIDE], atol=1e-9)
    for name, value in one.body_columns().items():
        sign = -1.0 if name in ("roll", "yaw", "cog_y") else 1.0
        assert_allclose(other.body_columns()[name], sign * np.asarray(value), atol=1e-9, err_msg=name)
