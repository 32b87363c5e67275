"""Feedforwards: what acts before an error is felt."""
