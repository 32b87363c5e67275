"""Export of stored runs for other programs: C code, wide tables, MCAP."""
