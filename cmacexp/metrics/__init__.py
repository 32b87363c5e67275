"""Metrics of tracking, force and learning, per cycle and leg, from a trace."""
