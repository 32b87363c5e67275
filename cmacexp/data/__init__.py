"""Stored runs: signals, tables, manifest, atomic files, search for runs, integrity."""
