"""Walks of the quadruped (Lin & Song 1997, section 6), made once by ``stored``, and how their laws read a run."""

import numpy as np
from scipy.spatial.transform import Rotation

STEPS = 600
"""Of a cycle."""
PERIOD = 0.005
WEIGHT = 40.0
HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])
LIFT_OFF = (480, 180, 360, 60)
TOUCH_DOWN = (0, 300, 480, 180)
"""Samples of the cycle, by leg."""

QUADRUPED = "scenario=quadruped"
ONE = (QUADRUPED, "cycles=1")
ALL_THREE = (QUADRUPED, "cycles=20")
FEEDBACK = (QUADRUPED, "cycles=3", "feedforward=none")
LITERAL = (QUADRUPED, "reference=literal", "cycles=10")
FELL = (QUADRUPED, "posture.gain=0", "cycles=2")
PATCHY = (QUADRUPED, "terrain=patchy", "gait.load_ramp=0.1", "cycles=6")


def in_world(body, points):
    """Points (n, 3) of the frame of a body (height, pitch, roll) relative to the ground below its centre.

    The frame is turned by roll about x (forward), then by pitch about y (left); z is up.
    """
    return Rotation.from_euler("YX", body[1:3]).apply(points) + np.array([0.0, 0.0, body[0]])


def feet_in_world(body, foot):
    """The same of feet (4, 2), x forward and y down in the frames of their hips."""
    return in_world(body, np.column_stack([HIPS[:, 0] + foot[:, 0], HIPS[:, 1], -foot[:, 1]]))


def of_legs(run, name):
    """A column of the trace (steps, 4)."""
    return run.trace[name].to_numpy().reshape(-1, 4)


def of_cycle(run, name, cycle):
    """A column of the trace (600, 4) in one cycle."""
    return of_legs(run, name)[(cycle - 1) * STEPS : cycle * STEPS]


def metrics_of(run):
    """Metrics by cycle and leg, but for those that compare a cycle with the one before."""
    return run.metrics.set_index(["cycle", "leg"]).drop(columns=["feedback_change", "feedback_growth"])


def pool(run):
    """Root mean square over the legs of every metric, and the body's metrics, by cycle."""
    legs = (metrics_of(run) ** 2).groupby(level="cycle").mean() ** 0.5
    return legs.join(run.body_metrics.set_index("cycle")).dropna(axis=1, how="all")
