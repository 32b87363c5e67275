"""Learned feedforward under contact: a benchmark of learning methods."""
