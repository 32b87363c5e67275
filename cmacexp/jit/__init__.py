"""Compiled kernels: what numba compiles, when, and where the machine code is cached."""
