"""Moving pictures of runs, robots as their models show them, and a table of recordings."""
