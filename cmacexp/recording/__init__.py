"""Rerun recordings of a run, or of several side by side, which can be rebuilt from the traces at any time."""
