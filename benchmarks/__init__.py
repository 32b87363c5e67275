"""Benchmarks: run times of the project as ratios to references; separate from the tests. See docs/sweeps.md."""
