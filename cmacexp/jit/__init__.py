"""Compiled kernels: what numba compiles, when, and where machine code is cached; interrupts that wait for it."""
