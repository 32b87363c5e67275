"""A mirrored gait or machine gives the mirrored walk."""

import pytest
from numpy.testing import assert_allclose
from support.rollout import roll_out

from cmacexp.loop.samples import BODY_SAMPLES
from cmacexp.loop.scenario import make_scenario

MIRRORED = "gait.touch_down=[0.5, 0.0, 0.3, 0.8]"
OTHER_SIDE = [1, 0, 3, 2]
MIRROR = [-1.0 if name in ("roll", "yaw", "cog_y") else 1.0 for name in BODY_SAMPLES]


@pytest.mark.parametrize(
    "overrides",
    [
        ["feedforward=none", "cycles=5"],
        ["cycles=8"],
        ["cycles=4", "reference=literal"],
        ["cycles=4", "posture.gain=4"],
    ],
    ids=" ".join,
)
def test_a_mirrored_gait_gives_the_mirrored_walk(make_config, overrides):
    """Also of what the CMACs learn: all have the same hash, and joint angles do not know left from right."""
    walked, mirrored = (
        roll_out(make_scenario(make_config("scenario=quadruped", *overrides, *gait))) for gait in ([], [MIRRORED])
    )
    assert (walked.status, len(walked.samples)) == (mirrored.status, len(mirrored.samples))
    assert_allclose(mirrored.samples, walked.samples[:, OTHER_SIDE], atol=1e-9)
    assert_allclose(mirrored.body_samples, walked.body_samples * MIRROR, atol=1e-9)


def test_a_mirrored_machine_gives_the_mirrored_walk_too(make_config):
    one = ["machine.legs.left_front.mass_1=0.7", "machine.legs.left_rear.length_2=0.37"]
    other = [override.replace("left", "right") for override in one]
    walked, mirrored = (
        roll_out(make_scenario(make_config("scenario=quadruped", "cycles=3", *overrides)))
        for overrides in (one, [*other, MIRRORED])
    )
    assert_allclose(mirrored.samples, walked.samples[:, OTHER_SIDE], atol=1e-9)
    assert_allclose(mirrored.body_samples, walked.body_samples * MIRROR, atol=1e-9)
