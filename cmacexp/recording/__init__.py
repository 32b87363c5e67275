"""A Rerun view of a run, or of several side by side, rebuilt from their traces at any time."""
