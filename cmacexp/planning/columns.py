"""Columns of the arrays of a plan; kernels and callers use these names instead of numbers."""

X, Y, VX, VY, AX, AY = range(6)
"""Of ``Plan.desired``, and the first four of ``Plan.reference``: m, m/s, m/s^2."""
Z, VZ, AZ = range(6, 9)
"""Of ``Plan.desired`` where feet move in space."""
FORCE_REFERENCE, FORCE_ADDED, FORCE_DESIRED = range(4, 7)
"""Further ones of ``Plan.reference``, N: F_r, force added to the feedback, desired contact force."""
REFERENCE_Z, REFERENCE_VZ = range(7, 9)
"""Of ``Plan.reference`` where feet move in space."""
REFERENCE_PLACE = (X, Y, REFERENCE_Z)
"""Of ``Plan.reference`` where a foot should be, those that there are."""
REFERENCE_COLUMNS = {2: 7, 3: 9}
"""By the number of axes."""
Q1, Q2, DQ1, DQ2, DDQ1, DDQ2 = range(6)
"""Of ``Plan.joints``: rad, rad/s, rad/s^2; of a point mass those of ``Plan.desired``."""
Q3, DQ3, DDQ3 = range(6, 9)
"""Of ``Plan.joints`` of legs with three joints."""
MOTION_COLUMNS = {2: 6, 3: 9}
"""Of ``Plan.desired`` and ``Plan.joints``, by the number of axes and joints."""
JOINT_COLUMNS = {"angle": (Q1, Q2, Q3), "velocity": (DQ1, DQ2, DQ3), "acceleration": (DDQ1, DDQ2, DDQ3)}
"""Columns of ``Plan.joints`` that an input of a network names, those that there are."""
BEFORE, ACTING = range(2)
"""Stages of a run, the first axis of ``Plan.reference``: before the feedforward acts, and since."""
