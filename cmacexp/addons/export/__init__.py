"""Runs for other programs: C code, wide tables, MCAP."""
