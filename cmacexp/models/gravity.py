"""Gravity, apart from the kernels: a config that is only looked at needs no compiler."""

GRAVITY = 9.81
"""m/s^2."""
