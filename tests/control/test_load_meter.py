"""What a body on legs measures of its own load and of the ground below it in a cycle, and how its plan adapts."""

from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose
from support.doors import make_scenario, new_observation

from cmacexp.control.load_meter import accumulate_load, new_load_meter, read_meter

ADAPTIVE = ("scenario=quadruped", "machine.weight=null", "force_control.load_sharing=adaptive")
STIFFNESS, DEPTH, SLOPES, TILT = 5000.0, 0.4, (0.05, -0.08), (0.01, 0.02)
"""Of the ground, N/m; of the ground below the body's centre, m; its rises, m/m; pitch and roll of the body, rad."""


def observe(hips, feet, forces):
    """What is seen of feet at places (L, 2), in the body's level frame, that press on sloped ground."""
    seen, (pitch, roll) = new_observation(len(hips)), TILT
    ground = DEPTH - feet @ SLOPES + np.array(forces) / STIFFNESS
    seen.body[1:], seen.force[:] = TILT, forces
    seen.foot[:, 1] = ground - pitch * feet[:, 0] + roll * feet[:, 1]
    seen.foot[:, 0] = feet[:, 0] - hips[:, 0] + pitch * seen.foot[:, 1]
    return seen


def test_a_meter_finds_the_weight_its_centre_and_the_slopes_of_the_ground(make_config):
    scenario = make_scenario(make_config(*ADAPTIVE, "feedforward=none"))
    config, mechanism = scenario.setup.config, scenario.setup.mechanism
    meter, hips = new_load_meter(config, mechanism), mechanism.hips
    meter = meter._replace(stiffness=STIFFNESS)
    load = SimpleNamespace(force=np.full(7, 30.0), mean_centre=np.array([0.01, -0.02]))
    for _ in range(2):  # the second cycle begins anew
        forces, places = [], []
        for shift, pressing in [(0.05, (9.0, 11.0, 0.0, 20.0)), (-0.05, (15.0, 10.0, 8.0, 11.0))]:
            feet = hips + np.array([shift, 0.0])
            seen = observe(hips, feet, pressing)
            feet = np.column_stack([feet[:, 0], hips[:, 1] + TILT[1] * seen.foot[:, 1]])  # planar legs tilt sideways
            seen = observe(hips, feet, pressing)
            accumulate_load(meter, np.array([True, True, True, True]), seen)
            forces, places = [*forces, *pressing], [*places, *feet]
        met = read_meter(meter, SimpleNamespace(load=load))
        centre = np.average(places, axis=0, weights=forces) - load.mean_centre
        assert_allclose(met, (sum(forces) / 2 - 30.0, *centre, *SLOPES), atol=2e-4)
