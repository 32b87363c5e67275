"""The benchmark of learned feedforward under contact: `python -m pipelines.benchmark`."""
