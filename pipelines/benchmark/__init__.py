"""The benchmark of learned feedforward under contact."""
