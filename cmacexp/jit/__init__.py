"""Just-in-time compilation by numba: kernels, programs, the cache of machine code, and deferred interrupts."""
