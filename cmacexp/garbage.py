"""How often a process looks for garbage."""

import gc


def collect_rarely() -> None:
    """Look for garbage rarely.

    Importing makes a hundred thousand objects that stay: looking for garbage among them takes longer than a run.
    """
    gc.set_threshold(100_000, 50, 50)
