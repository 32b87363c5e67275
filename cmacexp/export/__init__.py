"""Formats for other programs, written from a stored run."""
