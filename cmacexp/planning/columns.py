"""Columns of the arrays of a plan; kernels and callers use these names instead of numbers."""

X, Y, VX, VY, AX, AY = range(6)
"""Of ``Plan.desired``, and the first four of ``Plan.reference``: m, m/s, m/s^2."""
FORCE_REFERENCE, FORCE_ADDED, FORCE_DESIRED = range(4, 7)
"""Further ones of ``Plan.reference``, N: F_r, force added to the feedback, desired contact force."""
REFERENCE_COLUMNS = 7
Q1, Q2, DQ1, DQ2, DDQ1, DDQ2 = range(6)
"""Of ``Plan.joints``: rad, rad/s, rad/s^2; of a point mass those of ``Plan.desired``."""
JOINT_COLUMNS = {"angle": (Q1, Q2), "velocity": (DQ1, DQ2), "acceleration": (DDQ1, DDQ2)}
"""Columns of ``Plan.joints`` that an input of a network names."""
BEFORE, ACTING = range(2)
"""Stages of a run, the first axis of ``Plan.reference``: before the feedforward acts, and since."""
